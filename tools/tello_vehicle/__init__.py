"""An emulated Tello with the SDK's protocol on loopback, flight dynamics and video."""

from aerodaas.testing.channel import Impairment
from tools.tello_vehicle.emulator import EmulatedTello
from tools.tello_vehicle.options import TelloOptions, VideoOptions

__all__ = ["EmulatedTello", "Impairment", "TelloOptions", "VideoOptions"]
