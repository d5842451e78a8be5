"""stub"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from aerodaas.config.model import EnvironmentConfig
from aerodaas.service.schemas import Area


@dataclass(frozen=True)
class TenantLimits:
    max_height: float | None = None
    max_speed: float | None = None


def limited(
    config: EnvironmentConfig, robots: Collection[str], *, tenant: TenantLimits, area: Area | None
) -> EnvironmentConfig:
    return config


def catalogue(config: EnvironmentConfig) -> EnvironmentConfig:
    return config
