"""An application with classes of its own: a result, a camera and both kinds of scheduler."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from aerodaas import AeroListData, Analytics, Environment, Frame, TrajectoryScheduler, Waypoint
from aerodaas.cameras.base import Picture
from aerodaas.schedulers.analytics import AnalyticsScheduler, Drop, RunOnEdge, SendToCloud
from aerodaas.schedulers.trajectory.base import PlanningContext

_SECOND = 1_000_000_000


class Chessboard:
    """A camera that shows a chessboard, which changes its colours once a second."""

    model = None
    finished = False
    skipped = 0

    def __init__(self, sensor: Any, environment: Any) -> None:  # noqa: ANN401, ARG002 - a plug-in
        """Show as many squares as the settings say."""
        self._squares = int(sensor.settings["squares"])

    def open(self) -> None:
        """Need nothing."""

    def capture(self, stamp: int, pose: object) -> Picture:
        """Draw the board of this second."""
        del pose
        rows, columns = np.indices((self._squares, self._squares))
        light = (rows + columns + stamp // _SECOND) % 2 == 0
        board = np.where(np.kron(light, np.ones((16, 16), bool)), 240, 20)
        return Picture(np.repeat(board[..., None], 3, 2).astype(np.uint8), stamp)

    def close(self) -> None:
        """Hold nothing."""


@dataclass(frozen=True)
class Brightness:
    """How bright the corner of a picture is, 0 to 255."""

    corner: float


class CornerAnalytics(Analytics[Brightness]):
    """Looks at the upper left square; each of them is a task of the scheduler."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    isolated = True
    scheduled = True

    def process(self, item: Frame, context: object) -> Brightness:
        """Take the mean."""
        del context
        return Brightness(float(item.image[:16, :16].mean()))


class Farthest(TrajectoryScheduler):
    """Visits the farthest waypoint first."""

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> list[Waypoint]:
        """Order by distance."""
        here = situation.position
        return sorted(pending, key=lambda stop: -float(np.linalg.norm(stop.position - here)))


class Alternating(AnalyticsScheduler):
    """Runs every other task on the edge, sends the next to the cloud, and drops late ones."""

    def __init__(self) -> None:
        """Wait for tasks."""
        self._waiting: list[Any] = []
        self._sent = False

    def task_arrived(self, task: Any, now: int) -> Iterator[Any]:  # noqa: ANN401 - a plug-in
        """Keep it, or send it away at once."""
        del now
        self._sent = not self._sent
        if self._sent:
            self._waiting.append(task)
        else:
            yield SendToCloud(task, "its turn")

    def executor_idle(self, now: int) -> Iterator[Any]:
        """Give the edge the oldest task that can be in time."""
        while self._waiting:
            task = self._waiting.pop(0)
            if now + task.profile.edge_time <= task.deadline:
                yield RunOnEdge(task, "its turn")
                return
            yield Drop(task, "late")


def main() -> None:
    """Build the dataflow and fly it."""
    env = Environment("own.json")
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")
    env.set_analytics_scheduler(Alternating())
    env.set_trajectory_scheduler(Farthest())
    CornerAnalytics().deploy(edge).analyse(drone.get_sensor_by_id("board").get_data_stream())
    places = [("a", 2, 0), ("b", 9, 3), ("c", 4, 6)]
    drone.navigate(AeroListData([Waypoint(name, x, y, 3) for name, x, y in places]))
    drone.start_mission()


if __name__ == "__main__":
    main()
