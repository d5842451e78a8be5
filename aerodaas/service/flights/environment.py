"""The environment of one flight, from its order: the provider's, under the flight's limits."""

from __future__ import annotations

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located
from aerodaas.service.flights.order import FlightOrder
from aerodaas.service.flights.shared_camera import attached_config
from aerodaas.service.limits import limited
from aerodaas.service.rehearsal import rehearsal_config

__all__ = ["environment_of"]


def environment_of(order: FlightOrder) -> EnvironmentConfig:
    """The environment of a flight; raises ConfigError where the limits leave no room for it."""
    whole = located(EnvironmentConfig.load(order.fleet), order.fleet.parent)
    if order.attached is not None:
        return attached_config(whole, order.attached, order.mission)
    config = limited(
        whole,
        order.robots,
        tenant=order.limits,
        area=order.area,
        actuators=order.actuators,
    )
    return rehearsal_config(config, order.battery, order.seed) if order.rehearsal else config
