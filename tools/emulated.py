"""Base of emulated vehicles: a flight in the embedded simulator, and a thread on a socket."""

from __future__ import annotations

import socket
import threading
import time
from abc import ABC, abstractmethod
from types import TracebackType
from typing import ClassVar, Generic, TypeVar

import typer
from typing_extensions import Self

from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.simulation.airframe import Airframe
from aerodaas.simulation.autopilot import Autopilot, FlightLimits
from aerodaas.simulation.dynamics import Multirotor
from aerodaas.simulation.sensors import SensorNoise

__all__ = ["LONGEST_LEAP", "EmulatedFlight", "EmulatedVehicle", "watch"]

LONGEST_LEAP = 0.2
"""Longest step of one turn in seconds: a delayed host does not catch up."""


class EmulatedFlight:
    """Body, autopilot and battery; time moves in the subclass' `advance`."""

    def __init__(
        self,
        airframe: Airframe,
        rotor: Multirotor,
        limits: FlightLimits,
        noise: SensorNoise | None = None,
    ) -> None:
        """Fly `rotor`; the autopilot receives the true state with `noise`."""
        self._rotor = rotor
        self._exact = SensorNoise(0.0, "")
        self._autopilot = Autopilot(airframe, rotor, noise or self._exact, limits)

    @property
    def truth(self) -> Odometry:
        """Exact state of motion, ENU."""
        return self._exact.odometry(self._rotor.motion())

    @property
    def mode(self) -> VehicleMode:
        """The autopilot's flight mode."""
        return self._autopilot.mode

    @property
    def flying(self) -> bool:
        """True while the rotors carry it."""
        return self._autopilot.flying

    @property
    def charge(self) -> float:
        """Of the battery, 0 to 1."""
        return self._autopilot.battery.fraction


FlightT = TypeVar("FlightT", bound=EmulatedFlight)


class EmulatedVehicle(ABC, Generic[FlightT]):
    """A vehicle on loopback in real time, from `start` (or `with`) to `stop`."""

    kind: ClassVar[str]
    """Name of its thread."""

    def __init__(self, opened: socket.socket, flight: FlightT) -> None:
        """Listen at `opened`, which becomes its own."""
        self._socket = opened
        self.port: int = opened.getsockname()[1]
        """Where it listens for commands."""
        self._flight = flight
        self._lock = threading.RLock()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def truth(self) -> Odometry:
        """Exact state of motion."""
        with self._lock:
            return self._flight.truth

    @property
    def mode(self) -> VehicleMode:
        """Its flight mode."""
        with self._lock:
            return self._flight.mode

    def start(self) -> None:
        """Switch it on."""
        self._thread = threading.Thread(target=self._run, name=self.kind, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Switch it off."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
        self._release()
        self._socket.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    @abstractmethod
    def _run(self) -> None:
        """Listen, fly and talk until `_stopping` is set."""

    def _release(self) -> None:
        """Release everything besides the socket, once the thread has ended."""


def watch(vehicle: EmulatedVehicle[FlightT]) -> None:
    """Print each change of its mode with its position, until interrupted."""
    mode = None
    while True:
        if vehicle.mode is not mode:
            mode = vehicle.mode
            x, y, z = vehicle.truth.position
            typer.echo(f"{mode.value} at ({x:.1f}, {y:.1f}, {z:.1f}) m")
        time.sleep(0.2)
