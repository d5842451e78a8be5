"""An emulated multicopter that speaks PX4's or ArduPilot's MAVLink on loopback, and flies."""

from aerodaas.testing.channel import Impairment
from aerodaas.testing.mavlink.emulator import EmulatedAutopilot
from aerodaas.testing.mavlink.options import AutopilotOptions

__all__ = ["AutopilotOptions", "EmulatedAutopilot", "Impairment"]
