"""Shared by the MAVLink tests."""

from emulated import flight

__all__ = ["flight"]
