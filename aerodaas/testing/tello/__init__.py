"""An emulated Tello that speaks the SDK on loopback, flies and films."""

from aerodaas.testing.channel import Impairment
from aerodaas.testing.tello.emulator import EmulatedTello
from aerodaas.testing.tello.options import TelloOptions, VideoOptions

__all__ = ["EmulatedTello", "Impairment", "TelloOptions", "VideoOptions"]
