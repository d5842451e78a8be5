"""Shared by the tests of corrections."""

from emulated import flight

__all__ = ["flight"]
