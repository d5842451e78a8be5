"""Client of a flight whose application uses `RemoteAnalytics`, by the flight's API."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any
from urllib.parse import urlsplit

from aerodaas.config.checked import checked
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import ConfigError, MissionError, UnreachableError
from aerodaas.messages.mission import RobotStatus
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import CommandIn, MissionOut, NavigationIn, PictureForm, StreamKind
from aerodaas.service.own.access import OWN

__all__ = ["RemoteClient"]


class RemoteClient:
    """Client of one robot of a flight.

    >>> client = RemoteClient("http://127.0.0.1:8350")  # doctest: +SKIP
    >>> client.add_waypoints([{"id": "look", "x": 5, "y": 5, "z": 2}])  # doctest: +SKIP

    Each method raises UnreachableError if no flight answers, ConfigError or MissionError with the
    flight's own text where it refuses.
    """

    def __init__(self, url: str, token: str | None = None, robot: str | None = None) -> None:
        """Configure the client.

        Args:
            url: Address of the flight, such as `http://127.0.0.1:8350`.
            token: Token of the flight; None where it needs none.
            robot: Id of the robot; None for the only one that flies.

        Raises:
            ConfigError: For any other form of address.
        """
        if urlsplit(url).scheme != "http":
            raise ConfigError(f"a remote control's address is http://host:port, not {url!r}")
        self._client = ProviderClient(url, token or None, insecure=True)
        self._robot = robot

    def status(self) -> RobotStatus:
        """Return the status of mission and vehicle."""
        with _explained():
            mission = self._client.mission(OWN)
        return mission.status[self._robot_of(mission)]

    def add_waypoints(
        self,
        waypoints: Sequence[dict[str, Any]],
        *,
        ordered: bool = True,
        index: int | None = None,
    ) -> dict[str, Any]:
        """Add waypoints to the robot's plan.

        Args:
            waypoints: Each by the fields of `aerodaas.Waypoint`; metres, seconds, radians, m/s.
            ordered: Whether to keep their order; otherwise the scheduler chooses it.
            index: Number of waypoints of the same priority to visit before these.

        Returns:
            The drone's answer, with the reason by id for each refused waypoint.

        Raises:
            ConfigError: For malformed waypoints.
            MissionError: If the mission refuses all of them.
        """
        with _explained():
            content = {
                "robot": self._commanded(),
                "waypoints": list(waypoints),
                "ordered": ordered,
                "index": index,
            }
            wanted = checked(NavigationIn, content, "the waypoints")
            return _accepted(self._client.add_navigation(OWN, wanted))

    def command(self, name: str) -> dict[str, Any]:
        """Send `pause`, `resume`, `clear`, `return-home` or `land`; returns the drone's answer.

        Raises MissionError if the mission refuses.
        """
        with _explained():
            content = {"robot": self._commanded(), "command": name}
            wanted = checked(CommandIn, content, "the command")
            return _accepted(self._client.command(OWN, wanted))

    def frame(self) -> bytes:
        """Return the next picture of the robot's first camera as JPEG; waits for one."""
        with _explained():
            mission = self._client.mission(OWN)
            cameras = [n for n, kind in mission.streams.items() if kind is StreamKind.PICTURES]
            if not cameras:
                raise MissionError("no camera of this flight has a stream")
            form = PictureForm.JPEG
            with self._client.live(OWN, 1.0, cameras[0], pictures=form) as connection:
                for received in connection:
                    if not isinstance(received, MissionOut) and received.blob:
                        return received.blob
        raise MissionError("the flight was over before a picture came")

    def stream(self, rate: float = 5.0) -> Iterator[RobotStatus]:
        """Yield the status at each change, `rate` times a second at most, until the flight ends."""
        with _explained(), self._client.live(OWN, rate) as connection:
            for received in connection:
                if isinstance(received, MissionOut) and received.status:
                    yield received.status[self._robot_of(received)]

    def _commanded(self) -> str:
        """The robot that is named, or the only one that flies."""
        return self._robot or self._robot_of(self._client.mission(OWN))

    def _robot_of(self, mission: MissionOut) -> str:
        """The robot, which has told something; raises ConfigError where it has to be named."""
        flying = list(mission.status)
        if not flying or (self._robot or flying[0]) not in flying:
            raise MissionError("the mission has not said anything yet")
        if self._robot is None and len(flying) > 1:
            raise ConfigError(f"name one of the robots that fly: {', '.join(flying)}")
        return self._robot or flying[0]


def _accepted(answer: Answer) -> dict[str, Any]:
    if not answer.accepted:
        raise MissionError(answer.text)
    return asdict(answer)


@contextmanager
def _explained() -> Iterator[None]:
    """Say what to look at where no flight answers."""
    try:
        yield
    except UnreachableError as error:
        text = f"{error}; is the mission flying, and does it use RemoteAnalytics?"
        raise UnreachableError(text) from None
