"""An emulated Tello that speaks the SDK on loopback, flies and films."""

from aerodaas.testing.tello.emulator import EmulatedTello
from aerodaas.testing.tello.options import Impairment, TelloOptions, VideoOptions

__all__ = ["EmulatedTello", "Impairment", "TelloOptions", "VideoOptions"]
