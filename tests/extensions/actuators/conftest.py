"""Shared by the tests of actuators."""

from emulated import flight

__all__ = ["flight"]
