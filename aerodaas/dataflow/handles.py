"""The handles of sensors and compute resources that an application holds."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, TypeVar

from aerodaas.config.model import ComputeConfig, SensorConfig
from aerodaas.dataflow.graph import AeroStreamData, Graph, Node
from aerodaas.dataflow.interfaces import ICompute, IPullSensor, IPushSensor
from aerodaas.dataflow.names import PaperNames
from aerodaas.errors import UnknownIdError
from aerodaas.messages.frames import Frame
from aerodaas.messages.mission import MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry

__all__ = ["SENSOR_ITEMS", "Compute", "Here", "Sensor"]

E = TypeVar("E")

SENSOR_ITEMS: dict[str, type] = {
    "camera": Frame,
    "odometry": Odometry,
    "gps": GpsFix,
    "battery": Battery,
    "status": MissionStatus,
}
"""Type of the items of each type of sensor."""


class Sensor(PaperNames, IPushSensor[E], IPullSensor[E]):
    """A sensor of a robot or of the environment; read it as a stream, by callback, or by poll."""

    def __init__(
        self, graph: Graph, config: SensorConfig, properties: Callable[[], dict[str, Any]]
    ) -> None:
        """Sensor described by `config`, with its `properties` by name."""
        self._graph = graph
        self._config = config
        self._properties = properties
        self._poller: AeroStreamData[E] | None = None

    def get_sensor_id(self) -> str:
        """Return the unique ID of the sensor."""
        return self._config.id

    def get_sensor_property(self, name: str) -> str:
        """Return one property of the sensor.

        Args:
            name: `id`, `type`, `driver`, `rate` (in Hz), `robot` (empty for a sensor of the
                environment), or a setting of the driver, such as a camera's `width` in pixels
                and `horizontal_fov` in degrees.

        Returns:
            The value as text: the environment file's, or else the default.

        Raises:
            UnknownIdError: If the sensor has no such property.
            ConfigError: If one of the driver's settings is invalid.
        """
        known = self._properties()
        if name not in known:
            raise UnknownIdError(f"property of {self._config.id}", name, list(known))
        return str(known[name])

    def get_data_stream(self) -> AeroStreamData[E]:
        """Return the stream of the sensor's data.

        Raises GraphError in flight for a camera that is off.
        """
        name = self._config.full_id
        item = SENSOR_ITEMS[self._config.type]
        if name not in self._graph.nodes:
            self._graph.add(Node(name, "sensor", item, self._config, self._config.robot))
        return AeroStreamData(self._graph, name, item)

    def subscribe(self, callback: Callable[[E], None]) -> None:
        """Call `callback` with each item while the mission runs, in a thread of this process.

        Before the mission, from its start; in flight, from now on.
        """
        stream = self.get_data_stream()

        def deliver() -> None:
            for item in stream:
                callback(item)

        def start() -> None:
            threading.Thread(target=deliver, name=f"push {stream.name}", daemon=True).start()

        if self._graph.flying:
            start()
        else:
            self._graph.on_launch.append(start)

    def poll(self, timeout: float = 1.0) -> E:
        """Return the newest item, waiting up to `timeout` seconds for the first one.

        Raises GraphError before the mission has started, TimeoutError when nothing came,
        StopIteration if nothing has come and the mission is over.
        """
        if self._poller is None:
            self._poller = self.get_data_stream()
        return self._poller.get_newest(timeout)


class Compute(PaperNames, ICompute):
    """A compute resource, to `deploy` analytics on."""

    def __init__(
        self, graph: Graph, config: ComputeConfig, hardware: Callable[[], dict[str, Any]]
    ) -> None:
        """Resource described by `config`; `hardware` returns the properties of its nodes."""
        self.graph = graph
        self.config = config
        self._hardware = hardware

    def get_compute_id(self) -> str:
        """Return the unique ID of the compute resource."""
        return self.config.id

    def get_compute_properties(self) -> dict[str, Any]:
        """Return the properties of the compute resource; starts or joins Ray if necessary.

        Returns:
            The settings of the environment file (`id`, `kind`, `node`, `executors`,
            `compression`, `endpoint` and the resource's own), and the sums over
            its nodes of what Ray offers to actors: `nodes`, `cores`, `memory` in bytes, and
            `accelerators`, a number by name such as `{"GPU": 1.0, "H100": 1.0}`. An HTTP endpoint
            has no such sums.

        Raises:
            AeroDaaSError: If the cluster cannot be reached.
            ConfigError: If no node of the cluster fits the resource.
        """
        properties = self.config.model_dump(mode="json")
        return {**properties.pop("settings"), **properties, **self._hardware()}


class Here(PaperNames, ICompute):
    """The user's own side, to `deploy` analyses on whose code stays with the user.

    In a flight by a provider they run in the application's process, and their items come over the
    wire; in a flight of one's own that is the edge node beside the drone.
    """

    def __init__(self, graph: Graph) -> None:
        """The side of the user whose application has this `graph`."""
        self.graph = graph

    def get_compute_id(self) -> str:
        """Return `here`."""
        return "here"

    def get_compute_properties(self) -> dict[str, Any]:
        """Return `id` alone: the environment file says nothing of it."""
        return {"id": self.get_compute_id()}
