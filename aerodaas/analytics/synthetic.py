"""An analysis that takes time instead of computing, to study schedulers on any machine."""

from __future__ import annotations

import time
from typing import ClassVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.types.data import Frame, Readings
from aerodaas.types.errors import ConfigError

__all__ = ["SyntheticAnalytics"]


class SyntheticAnalytics(Analytics[Readings]):
    """Stands in for a model: sleeps as long as the model would take, then answers.

    It occupies no core, so that the timing of a whole set of models can be had on two.
    """

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Readings
    scheduled = True
    concurrent = True

    def __init__(self, name: str, edge_ms: float, cloud_ms: float) -> None:
        """Take `edge_ms` milliseconds on the edge and `cloud_ms` in the cloud.

        `name` is that of the stream, under which the environment file gives benefit and costs.
        Raises ConfigError for times that are negative or not finite.
        """
        for what, value in (("edge_ms", edge_ms), ("cloud_ms", cloud_ms)):
            if not 0 <= value < float("inf"):
                raise ConfigError(f"{name}: {what} must be 0 or more, not {value}")
        self.name = name
        self._seconds = {"edge": edge_ms / 1000, "cloud": cloud_ms / 1000}

    def process(self, item: Frame, context: Context) -> Readings:
        """Take the time, then say how long it was."""
        time.sleep(self._seconds[context.kind])
        return Readings(item.header.stamp, {"seconds": self._seconds[context.kind]})
