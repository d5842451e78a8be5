"""An emulated multicopter that speaks PX4's or ArduPilot's MAVLink on loopback, and flies."""

from aerodaas.testing.channel import Impairment
from tools.mavlink_vehicle.emulator import EmulatedAutopilot
from tools.mavlink_vehicle.options import AutopilotOptions

__all__ = ["AutopilotOptions", "EmulatedAutopilot", "Impairment"]
