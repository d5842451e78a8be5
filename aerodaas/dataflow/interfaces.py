"""The paper's interfaces (its API table), as typed abstract base classes.

Methods are snake_case; the paper's spellings (`getRobotByID`) work on every implementation
through `aerodaas.dataflow.names.PaperNames`. The input and output types are those of the table.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from typing_extensions import Self

if TYPE_CHECKING:
    from aerodaas.dataflow.containers import AeroData
    from aerodaas.dataflow.graph import AeroStreamData
    from aerodaas.dataflow.navigation import AeroNavigation

__all__ = [
    "IAeroData",
    "IAnalyse",
    "ICompute",
    "IDeployable",
    "IEnvironment",
    "IMonitoringAnalytics",
    "INavigableAnalyse",
    "INavigate",
    "IPullSensor",
    "IPushSensor",
    "IRobot",
    "ISensor",
]

E = TypeVar("E")
O_co = TypeVar("O_co", covariant=True)


class IAeroData(ABC, Generic[E]):
    """A data item of type E."""

    @abstractmethod
    def get_data(self) -> E:
        """Return a data item of type E."""

    @abstractmethod
    def set_data(self, data: E) -> None:
        """Set a data item of type E."""


class ICompute(ABC):
    """A place where analytics can run: an edge node, a cloud node, a function endpoint."""

    @abstractmethod
    def get_compute_id(self) -> str:
        """Return the unique ID of the compute resource."""

    @abstractmethod
    def get_compute_properties(self) -> dict[str, Any]:
        """Return the properties of the compute resource: kind, cores, memory, accelerators."""


class ISensor(ABC, Generic[E]):
    """A source of data on a robot or in the environment."""

    @abstractmethod
    def get_sensor_property(self, name: str) -> str:
        """Return one property of the sensor, such as "rate" or "width", as text."""

    @abstractmethod
    def get_sensor_id(self) -> str:
        """Return the unique ID of the sensor."""

    @abstractmethod
    def get_data_stream(self) -> AeroStreamData[E]:
        """Return the stream of the sensor's data: an edge of the graph, an iterator in flight."""


class IPushSensor(ISensor[E]):
    """A sensor that calls back for each new item."""

    @abstractmethod
    def subscribe(self, callback: Callable[[E], None]) -> None:
        """Call `callback` with each item while the mission runs, in the application's process."""


class IPullSensor(ISensor[E]):
    """A sensor that is asked for its newest item."""

    @abstractmethod
    def poll(self, timeout: float = 1.0) -> E:
        """Return the newest item, waiting up to `timeout` seconds for the first one."""


class IDeployable(ABC):
    """Something that can be placed on a compute resource."""

    @abstractmethod
    def deploy(self, compute: ICompute) -> Self:
        """Assign the compute resource that executes the analysis; returns itself."""


class IAnalyse(IDeployable, Generic[O_co]):
    """An analysis of streams, or of single items."""

    @overload
    def analyse(self, data: AeroStreamData[Any]) -> AeroStreamData[O_co]: ...
    @overload
    def analyse(self, data: AeroData[Any]) -> AeroData[O_co | None]: ...
    @abstractmethod
    def analyse(self, data: IAeroData[Any]) -> IAeroData[Any]:
        """Analyse a stream, whose results are a stream of their own; or one item, at once."""

    @abstractmethod
    def instantiate(self) -> AeroStreamData[O_co]:
        """Start an analysis that receives its data from an external source."""

    @abstractmethod
    def trigger(
        self,
        target: IAnalyse[Any] | Callable[[], None],
        when: Callable[[Any], bool] | None = None,
    ) -> Self:
        """Wake another analysis, or command a robot, when a result says so.

        Args:
            target: Another analysis, or a robot's method.
            when: Condition on each result; None for every result that is not None.
        """


class IMonitoringAnalytics(IAnalyse[O_co]):
    """An analysis whose results are readings of a robot and its mission, to be watched."""


class INavigate(ABC):
    """A trajectory scheduler's queue of navigation."""

    @abstractmethod
    def generate_navigation(self, data: IAeroData[Any]) -> AeroNavigation:
        """Make navigation that this scheduler will order, of waypoints or of a stream."""

    @abstractmethod
    def add_navigation(
        self,
        data: IAeroData[Any],
        index: int | None = None,
        *,
        priority: int | None = None,
        deadline: float | None = None,
        robot: IRobot | str | None = None,
    ) -> None:
        """Add navigation to a robot's queue.

        Args:
            data: Waypoints, or a stream of them.
            index: Number of waypoints of the same priority to visit before these.
            priority: Priority of the waypoints; None for their own.
            deadline: Mission time in seconds for waypoints with no deadline, or a later one.
            robot: Robot, or its id; None where only one flies.
        """

    @abstractmethod
    def clear_navigation(
        self, *, on: AeroStreamData[Any] | None = None, robot: IRobot | str | None = None
    ) -> None:
        """Empty a robot's queue.

        Args:
            on: Stream whose first item empties it; None for now.
            robot: Robot, or its id; None where only one flies.
        """


class INavigableAnalyse(IAnalyse["AeroNavigation"]):
    """An analysis whose results are navigation."""

    @abstractmethod
    def generate_navigation(self, data: IAeroData[Any]) -> AeroStreamData[AeroNavigation]:
        """Turn analytics' results into navigation; the same as `analyse`, as the table names it."""


class IRobot(ABC):
    """A drone (or another robot) and its mission."""

    @abstractmethod
    def start_mission(self) -> None:
        """Run the user's hook, then fly the mission."""

    @abstractmethod
    def end_mission(self) -> None:
        """End the mission: land, then run the user's hook."""

    @abstractmethod
    def pause_mission(self) -> None:
        """Pause the ongoing mission by putting the drone in hover mode."""

    @abstractmethod
    def resume_mission(self) -> None:
        """Resume the ongoing mission."""

    @abstractmethod
    def has_sensors(self) -> bool:
        """Return True if the robot has any onboard sensors."""

    @abstractmethod
    def get_sensors(self) -> list[ISensor[Any]]:
        """Return all the sensors on board."""

    @abstractmethod
    def get_sensor_by_id(self, sensor_id: str) -> ISensor[Any]:
        """Return the requested sensor; raises UnknownIdError."""

    @abstractmethod
    def is_navigable(self) -> bool:
        """Return True if the robot is navigable."""

    @abstractmethod
    def navigate(self, data: IAeroData[Any]) -> None:
        """Fly by this navigation once the mission starts."""


class IEnvironment(ABC):
    """Robots, sensors and compute resources, from a file or discovered."""

    @abstractmethod
    def has_env_sensors(self) -> bool:
        """Return True if the environment has sensors."""

    @abstractmethod
    def get_env_sensors(self) -> list[ISensor[Any]]:
        """Return the sensors in the environment."""

    @abstractmethod
    def get_env_sensor_by_id(self, sensor_id: str) -> ISensor[Any]:
        """Return the requested sensor; raises UnknownIdError."""

    @abstractmethod
    def get_env_robots(self) -> list[IRobot]:
        """Return all the robots available in the environment."""

    @abstractmethod
    def get_robot_by_id(self, robot_id: str) -> IRobot:
        """Return the requested robot; raises UnknownIdError."""

    @abstractmethod
    def is_robot_sensor_available(self, sensor_id: str) -> bool:
        """Return True if a robot has the required onboard sensor."""

    @abstractmethod
    def get_robot_sensors(self) -> list[ISensor[Any]]:
        """Return the sensors of all robots in the environment."""

    @abstractmethod
    def get_compute_resources(self) -> list[ICompute]:
        """Return all the compute resources available."""

    @abstractmethod
    def get_compute_resource_by_id(self, compute_id: str) -> ICompute:
        """Return the requested compute resource; raises UnknownIdError."""

    @abstractmethod
    def set_trajectory_scheduler(self, scheduler: INavigate) -> None:
        """Plug in the trajectory scheduler."""

    @abstractmethod
    def set_analytics_scheduler(self, scheduler: Any) -> None:  # noqa: ANN401 - name, class or instance
        """Plug in the analytics scheduler: a name, `module:Class`, or an instance."""
