"""The programs of PX4 and ArduCopter in simulation, and how each is started.

Neither is part of this project. PX4 is a build of its own source tree with SIH, its simulation in
hardware; ArduCopter is the program that `sim_vehicle.py` builds.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from aerodaas.errors import SourceError

__all__ = ["PROGRAMS", "Family", "SimulatedHome", "SitlOptions", "SitlProgram"]

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
    system: int | None = None
    """Its system id; None: the program's own."""
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
    if options.system is not None:
        raise SourceError("px4 has its instance and one as its system id: give --instance")
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
    if options.system is not None:
        command += ["--sysid", str(options.system)]
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
