"""Equipment of a MAVLink vehicle, and services of its autopilot, that extensions bring."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import ClassVar

from aerodaas.config.extensions import added
from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink.connecting import Connection
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.vehicle import VehicleState

__all__ = ["ComponentContext", "MavlinkComponent", "MessageHandler", "mavlink_components"]

MessageHandler = Callable[[Message, float], None]
"""Processes a message at a second of the monotonic clock."""


@dataclass(frozen=True)
class ComponentContext:
    """The vehicle to which a component belongs."""

    robot: RobotConfig
    settings: MavlinkSettings
    telemetry: Telemetry
    """Newest messages of the autopilot."""
    phase: FlightPhase
    """Flight mode of the autopilot, and the one that it was asked for."""
    change_mode: Callable[[FlightMode, Callable[[str], None]], None]
    """Asks the autopilot for a mode; the second is called with the reason of a refusal."""
    lock: AbstractContextManager[object]
    """Held while the driver calls the component, which may be in another thread."""
    now: Callable[[], int]
    """Mission clock, nanoseconds."""


class MavlinkComponent:
    """A component of one vehicle (`Extension.mavlink_components`), one of its `equipment`.

    The link's thread calls the handlers and `step`, the loop's thread the rest, under one lock.
    Seconds are monotonic.
    """

    senders: ClassVar[frozenset[int]] = frozenset()
    """Ids of the components of the vehicle, beside its autopilot, from which its messages come.

    Where there are any, these messages do not count as a word of the autopilot: a transmitter that
    goes on talking does not hide that the vehicle is silent."""
    component_ids: ClassVar[frozenset[int]] = frozenset()
    """Ids of the components of the vehicle whose every message goes to `on_component_message`."""

    def __init__(self, context: ComponentContext) -> None:
        """Prepare for a vehicle that is not connected yet."""
        self.context = context
        self.connection: Connection | None = None
        """None before the vehicle is connected."""

    @property
    def handlers(self) -> Mapping[str, MessageHandler]:
        """Handlers by the name of their message, of which no other component has any."""
        return {}

    @property
    def changes_mode(self) -> bool:
        """Whether it has asked for a mode, in which setpoints do not matter, and awaits it."""
        return False

    def connect(self, connection: Connection) -> None:
        """Serve a vehicle that is connected from now on."""
        self.connection = connection

    def on_component_message(self, message: Message, now: float) -> None:
        """Process a message of a component with one of its `component_ids`.

        Args:
            message: The message.
            now: Monotonic clock.
        """

    def step(self, now: float) -> None:
        """Send what is due; called 20 times a second.

        Args:
            now: Monotonic clock.
        """

    def complete(self, state: VehicleState, now: float, placed_at: float) -> VehicleState:
        """Return the vehicle's state with what this component knows.

        Args:
            state: The newest state.
            now: Monotonic clock.
            placed_at: The same clock at the state's position.
        """
        del now, placed_at
        return state

    def complete_health(self, readings: HealthReadings, now: float) -> HealthReadings:
        """Return the vehicle's health with what this component knows.

        Args:
            readings: The newest readings.
            now: Monotonic clock.
        """
        del now
        return readings

    def description(self) -> list[str]:
        """Lines for somebody who looks at the vehicle before a flight."""
        return []

    def close(self, pause: Callable[[], None]) -> None:
        """End what goes on, before the link is closed; called without the lock.

        Args:
            pause: Waits a little for the next message.
        """


def mavlink_components(context: ComponentContext) -> list[MavlinkComponent]:
    """The components that extensions bring for a vehicle."""
    return [component(context) for component in added("mavlink_components")]
