"""A synthetic analysis that sleeps instead of computing, to study schedulers on any machine."""

from __future__ import annotations

import time
from typing import ClassVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.config.checked import NotNegative
from aerodaas.errors import ConfigError
from aerodaas.messages.frames import Frame
from aerodaas.messages.readings import Readings

__all__ = ["SyntheticAnalytics"]


class SyntheticAnalytics(Analytics[Readings]):
    """A stand-in for a model that sleeps for the model's execution time.

    It occupies no core, so that the timing of many models can be studied on a two-core machine.
    """

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Readings
    scheduled = True
    concurrent = True

    def __init__(self, name: str, edge_ms: NotNegative, cloud_ms: NotNegative) -> None:
        """Set the execution times.

        Args:
            name: Name of the stream, under which the environment file gives benefit and costs.
            edge_ms: Execution time on the edge, milliseconds.
            cloud_ms: Execution time in the cloud, milliseconds.

        Raises:
            ConfigError: If a time is negative or not finite.
        """
        for what, value in (("edge_ms", edge_ms), ("cloud_ms", cloud_ms)):
            if not 0 <= value < float("inf"):
                raise ConfigError(f"{name}: {what} must be 0 or more, not {value}")
        self.name = name
        self._seconds = {"edge": edge_ms / 1000, "cloud": cloud_ms / 1000}

    def process(self, item: Frame, context: Context) -> Readings:
        """Sleep for the execution time, and return it in seconds.

        Args:
            item: Frame, whose stamp the result has.
            context: Services of its node, whose kind selects the time.
        """
        time.sleep(self._seconds[context.kind])
        return Readings(item.header.stamp, {"seconds": self._seconds[context.kind]})
