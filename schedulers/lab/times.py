"""Execution times: the table's figures, or draws from a named distribution around them."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal, cast

from aerodaas.errors import SchedulerError

__all__ = ["ExecutionTimes"]


@dataclass(frozen=True, slots=True)
class ExecutionTimes:
    """How long executions take, as a factor on the expected time.

    The factor has the given coefficient of variation. The table's time is its mean or, with
    `quantile` (lognormal only), that quantile: published times are often high percentiles.
    """

    distribution: Literal["nominal", "lognormal", "gamma"] = "nominal"
    variation: float = 0.0
    quantile: float | None = None

    def __post_init__(self) -> None:
        """Raise SchedulerError for figures that make no distribution."""
        if self.distribution not in {"nominal", "lognormal", "gamma"}:
            raise SchedulerError(
                f"execution times are nominal, lognormal or gamma, not {self.distribution!r}"
            )
        if not 0 <= self.variation < math.inf:
            raise SchedulerError(f"a coefficient of variation is >= 0, not {self.variation}")
        if self.quantile is not None and not (
            0 < self.quantile < 1 and self.distribution == "lognormal"
        ):
            raise SchedulerError("a quantile lies between 0 and 1 and goes with lognormal times")

    @classmethod
    def named(cls, text: str) -> ExecutionTimes:
        """Read `nominal`, `lognormal:0.15`, `gamma:0.15` or `lognormal:0.15@0.95`.

        The first figure is the coefficient of variation, the second one the quantile. Raises
        SchedulerError.
        """
        name, _, setting = text.partition(":")
        variation, _, quantile = setting.partition("@")
        try:
            return cls(
                cast("Literal['nominal', 'lognormal', 'gamma']", name),
                float(variation or 0.0),
                float(quantile) if quantile else None,
            )
        except ValueError:
            raise SchedulerError(
                f"times {text!r}: write nominal, lognormal:0.15 or gamma:0.15"
            ) from None

    @property
    def name(self) -> str:
        """As `named` reads it."""
        quantile = "" if self.quantile is None else f"@{self.quantile:g}"
        spread = "" if self.distribution == "nominal" else f":{self.variation:g}{quantile}"
        return f"{self.distribution}{spread}"

    def factors(self, count: int, draw: random.Random) -> list[float]:
        """Draw `count` factors, all positive."""
        cv = self.variation
        if self.distribution == "nominal" or cv == 0:
            return [1.0] * count
        if self.distribution == "gamma":
            shape = 1 / cv**2
            return [draw.gammavariate(shape, 1 / shape) for _ in range(count)]
        sigma = math.sqrt(math.log1p(cv**2))
        mu = -(sigma**2) / 2
        if self.quantile is not None:
            mu = -sigma * NormalDist().inv_cdf(self.quantile)
        return [draw.lognormvariate(mu, sigma) for _ in range(count)]
