"""The programs of PX4 and ArduCopter in simulation, each from its start to its end.

Neither is part of this project. PX4 is a build of its own source tree with SIH, its simulation in
hardware; ArduCopter is the program that `sim_vehicle.py` builds.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, TypeAlias

from typing_extensions import Self

from aerodaas.errors import SourceError

__all__ = ["PROGRAMS", "Family", "SimulatedHome", "SitlOptions", "SitlProcess", "SitlProgram"]

Family: TypeAlias = Literal["px4", "ardupilot"]
_FIRST_PORT = 14540
_HOST = "127.0.0.1"
_PX4_BUILDS = ("px4_sitl_sih", "px4_sitl_default")
_COPTER_PARAMETERS = "Tools/autotest/default_params/copter.parm"


@dataclass(frozen=True)
class SimulatedHome:
    """Where it starts: WGS84 degrees, metres above the sea, degrees clockwise from north."""

    latitude: float = 47.397742
    longitude: float = 8.545594
    altitude: float = 488.0
    heading: float = 0.0


@dataclass(frozen=True)
class SitlOptions:
    """How a simulator is to be started."""

    state: Path
    """Folder for what it writes."""
    source: Path | None = None
    """Where it is installed; None for its variable, or PATH."""
    home: SimulatedHome = SimulatedHome()
    speed: float = 1.0
    """Simulated seconds a second."""
    instance: int = 0
    """Number among several at once, from 0; each has ports of its own."""
    port: int | None = None
    """UDP port of this machine at which its vehicle is to be heard; None: 14540 and the instance.
    """
    defaults: Sequence[Path] = ()
    """Files of parameters, the later ones over the earlier."""

    @property
    def heard_at(self) -> tuple[str, int]:
        """Address at which the vehicle is to be heard."""
        return _HOST, _FIRST_PORT + self.instance if self.port is None else self.port


@dataclass(frozen=True)
class SitlProgram:
    """A program, ready to be started."""

    command: Sequence[str]
    environment: Mapping[str, str]
    """On top of this process' own."""


def _px4(options: SitlOptions) -> SitlProgram:
    program = _found(
        "px4",
        "AERODAAS_PX4",
        options.source,
        (f"build/{build}/bin/px4" for build in _PX4_BUILDS),
        "build it in its source tree (`make px4_sitl`, or from 1.18 on `make px4_sitl_sih`)",
    )
    if options.port not in {None, _FIRST_PORT + options.instance}:
        raise SourceError("px4 speaks to port 14540 and its instance: give --instance, no --port")
    if options.defaults:
        raise SourceError("px4 takes no file of parameters here: set them by PX4_PARAM_NAME=value")
    if options.home.heading:
        raise SourceError("px4 begins looking north in its simulation: give a home without heading")
    home = options.home
    etc = program.parent.parent / "etc"
    command = [str(program), "-d", "-i", str(options.instance), "-w", str(options.state), str(etc)]
    environment = {
        "PX4_SIM_MODEL": "sihsim_quadx",
        "PX4_SIM_SPEED_FACTOR": f"{options.speed:g}",
        "PX4_HOME_LAT": f"{home.latitude:.7f}",
        "PX4_HOME_LON": f"{home.longitude:.7f}",
        "PX4_HOME_ALT": f"{home.altitude:.2f}",
    }
    return SitlProgram(command, environment)


def _ardupilot(options: SitlOptions) -> SitlProgram:
    program = _found(
        "arducopter",
        "AERODAAS_ARDUPILOT",
        options.source,
        ("build/sitl/bin/arducopter", "arducopter"),
        "build it in its source tree (`./waf configure --board sitl`, `./waf copter`)",
    )
    defaults = [*_copter_parameters(program), *options.defaults]
    if not defaults:
        raise SourceError(
            f"{program} needs ArduPilot's parameters of a copter, which are not beside it: give "
            f"--defaults with the {_COPTER_PARAMETERS} of its source tree"
        )
    home, (host, port) = options.home, options.heard_at
    place = (home.latitude, home.longitude, home.altitude, home.heading)
    command = [
        *(str(program), "--wipe", "--model", "quad", "--speedup", f"{options.speed:g}"),
        *("--defaults", ",".join(map(str, defaults))),
        *("--home", ",".join(f"{number:.9g}" for number in place), "-I", str(options.instance)),
        # By default it listens on every interface of the machine.
        *("--serial0", f"udpclient:{host}:{port}", "--serial1", "none", "--serial2", "none"),
    ]
    return SitlProgram(command, {})


PROGRAMS: Mapping[Family, Callable[[SitlOptions], SitlProgram]] = {
    "px4": _px4,
    "ardupilot": _ardupilot,
}
"""What is started, by family; each raises SourceError that says what is missing."""


def _found(
    name: str, variable: str, source: Path | None, places: Iterable[str], remedy: str
) -> Path:
    """The program in a folder that is named, or on PATH."""
    named = source or (Path(os.environ[variable]) if os.environ.get(variable) else None)
    looked = []
    if named is not None:
        for place in [named] if named.is_file() else [named / one for one in places]:
            if place.is_file() and os.access(place, os.X_OK):
                return place.resolve()
            looked.append(str(place))
    else:
        on_path = shutil.which(name)
        if on_path is not None:
            return Path(on_path).resolve()
        looked.append(f"{name} on PATH")
    raise SourceError(
        f"there is no {name}: looked for {', '.join(looked)}. Name its source tree or the program "
        f"by --from or {variable}, or {remedy}"
    )


def _copter_parameters(program: Path) -> list[Path]:
    """ArduPilot's own parameters of a copter, of the source tree around its program."""
    trees = [*program.parents, program.parent / "ardupilot"]
    found = (tree / _COPTER_PARAMETERS for tree in trees)
    return [file for file in found if file.is_file()][:1]


_MAGIC = (0xFD, 0xFE)
"""First byte of a MAVLink packet."""
_LOOK = 0.1
"""Seconds between two looks."""
_ENDING = 5.0
"""Seconds from SIGTERM to SIGKILL."""
_LAST_LINES = 5
"""Lines of a dead simulator's output that are told."""
_PACKET = 2048


class SitlProcess:
    """A simulator that flies for as long as the `with` lasts."""

    def __init__(self, family: Family, options: SitlOptions, timeout: float = 30.0) -> None:
        """Find the program; raises SourceError if there is none.

        `timeout` in seconds is what it gets until its vehicle is heard.
        """
        self.program = PROGRAMS[family](options)
        self.log: Path = options.state / "simulator.log"
        """What it prints."""
        self.url = "udpin:{}:{}".format(*options.heard_at)
        """Of the vehicle, for the setting `url` of the driver `mavlink`."""
        self._options = options
        self._timeout = timeout
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        """Start it, and wait until its vehicle is heard.

        Raises SourceError if its port is taken, if it dies, or says nothing in time.
        """
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
            try:
                heard.bind(self._options.heard_at)
            except OSError as error:
                raise SourceError(
                    f"port {self._options.heard_at[1]} is taken ({error.strerror}): end what flies "
                    "there, or give another --instance"
                ) from None
            heard.settimeout(_LOOK)
            self._options.state.mkdir(parents=True, exist_ok=True)
            with self.log.open("ab") as log:
                self._process = subprocess.Popen(  # noqa: S603 - what the user has installed
                    self.program.command,
                    cwd=self._options.state,
                    env={**os.environ, **self.program.environment},
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            try:
                self._await_word(heard)
            except BaseException:
                self.stop()
                raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _await_word(self, heard: socket.socket) -> None:
        deadline = time.monotonic() + self._timeout
        while time.monotonic() < deadline:
            self.require_alive()
            with contextlib.suppress(TimeoutError):
                packet = heard.recv(_PACKET)
                if packet and packet[0] in _MAGIC:
                    return
        raise SourceError(
            f"{self.program.command[0]} said nothing at {self.url} within {self._timeout:g} s"
            f"{self._said()}"
        )

    def require_alive(self) -> None:
        """Raise SourceError, with its last words, if it has ended."""
        code = None if self._process is None else self._process.poll()
        if code is not None:
            ended = f"by signal {-code}" if code < 0 else f"with code {code}"
            raise SourceError(f"{self.program.command[0]} has ended {ended}{self._said()}")

    def wait(self) -> None:
        """Return never; raises SourceError when it ends by itself."""
        while True:
            self.require_alive()
            time.sleep(_LOOK)

    def _said(self) -> str:
        lines = self.log.read_text(errors="replace").splitlines() if self.log.is_file() else []
        last = "".join(f"\n  {line}" for line in lines[-_LAST_LINES:])
        return f"; its last words, of {self.log}:{last}" if last else "; it printed nothing"

    def stop(self) -> None:
        """End it, and what it has started, by their own session; nothing else is touched."""
        process, self._process = self._process, None
        if process is None:
            return
        for number in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_ENDING)
