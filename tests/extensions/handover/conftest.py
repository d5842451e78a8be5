"""Shared by the tests of handovers."""

from emulated import flight

__all__ = ["flight"]
