"""A robot's health before take-off, as a service and a flight's console tell it."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from aerodaas.clock import seconds
from aerodaas.messages.health import HealthItem, HealthReport, Verdict, gravest
from aerodaas.protocol.bases import AnswerModel

__all__ = ["PreflightOut"]


class PreflightOut(AnswerModel):
    """The list before take-off of one robot, as it was when it was gone through last."""

    robot: str
    verdict: Verdict | None = None
    """The gravest of the items; None where the list was never gone through."""
    age: float | None = None
    """Seconds since then: of the mission's clock while a mission flies it."""
    items: list[HealthItem] = Field(default_factory=list)

    @classmethod
    def of(cls, robot: str, items: Sequence[HealthItem], age: float | None) -> PreflightOut:
        """The list with its verdict; `age` in seconds."""
        if not items:
            return cls(robot=robot)
        return cls(robot=robot, verdict=gravest(items), age=age, items=list(items))

    @classmethod
    def of_flight(cls, robot: str, report: HealthReport | None, now: int) -> PreflightOut:
        """The list of a flight's setpoint loop; `now` is its clock's, nanoseconds."""
        if report is None:
            return cls(robot=robot)
        return cls.of(robot, report.items, seconds(max(0, now - report.stamp)))
