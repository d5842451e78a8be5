"""Rehearsal of a mission in simulation: its environment, its verdict and its picture."""

from __future__ import annotations

from aerodaas.service.rehearsal.findings import OtherArea, judge

__all__ = ["OtherArea", "judge"]
