"""Shared by the tests of vehicles' logs."""

from emulated import flight
from sitl.conftest import autopilot, boot

__all__ = ["autopilot", "boot", "flight"]
