"""An emulated Tello with the SDK's protocol on loopback, flight dynamics and video."""

from aerodaas.testing.channel import Impairment
from aerodaas.testing.tello.emulator import EmulatedTello
from aerodaas.testing.tello.options import TelloOptions, VideoOptions

__all__ = ["EmulatedTello", "Impairment", "TelloOptions", "VideoOptions"]
