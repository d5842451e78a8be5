"""Shared by the tests of gimbal and camera."""

from emulated import flight

__all__ = ["flight"]
