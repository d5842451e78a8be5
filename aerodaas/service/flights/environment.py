"""The environment of one flight, from its order: the provider's, under the flight's limits."""

from __future__ import annotations

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located
from aerodaas.service.flights.order import FlightOrder
from aerodaas.service.limits import limited
from aerodaas.service.rehearsal import rehearsal_config

__all__ = ["environment_of"]


def environment_of(order: FlightOrder) -> EnvironmentConfig:
    """The environment of a flight; raises ConfigError where the limits leave no room for it."""
    config = limited(
        located(EnvironmentConfig.load(order.fleet), order.fleet.parent),
        order.robots,
        tenant=order.limits,
        area=order.area,
    )
    return rehearsal_config(config, order.battery, order.seed) if order.rehearsal else config
