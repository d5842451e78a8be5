"""Shared by the tests of extensions."""

from emulated import flight

__all__ = ["flight"]
