"""`aerodaas sim`: an autopilot in simulation that the user has installed."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from aerodaas.cli.options import ExampleGroup
from aerodaas.errors import ConfigError, SourceError

if TYPE_CHECKING:
    from aerodaas.extensions.sitl.process import Family, SimulatedHome, SitlProcess

__all__ = ["app"]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Start PX4 or ArduCopter in simulation, which has to be installed already.

    aerodaas sim ardupilot --from ~/ardupilot
    aerodaas sim px4 --from ~/PX4-Autopilot --run my_app.py
""",
)

Source: TypeAlias = Annotated[
    Path | None,
    typer.Option("--from", help="Its source tree, or the program. Default: its variable, or PATH."),
]
State: TypeAlias = Annotated[
    Path | None, typer.Option(help="Folder for what it writes. Default: one that is removed.")
]
Place: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="LAT,LON[,ALT[,HEADING]]",
        help="Where it starts: degrees, metres above the sea, degrees clockwise from north.",
    ),
]
Environment: TypeAlias = Annotated[
    Path | None, typer.Option("--env", help="Environment file by whose home it starts.")
]
Speed: TypeAlias = Annotated[
    float, typer.Option(min=0.1, max=50, help="Simulated seconds a second.")
]
Instance: TypeAlias = Annotated[
    int, typer.Option(min=0, max=9, help="Number among several at once.")
]
Port: TypeAlias = Annotated[
    int | None,
    typer.Option(min=1024, max=65535, help="UDP port for its vehicle. Default: 14540 + instance."),
]
Defaults: TypeAlias = Annotated[
    list[Path] | None, typer.Option(help="A file of parameters, over the program's own.")
]
Run: TypeAlias = Annotated[
    Path | None, typer.Option("--run", help="Fly this application on it, and end it afterwards.")
]
RobotId: TypeAlias = Annotated[str, typer.Option(help="The robot that it is.")]


@app.command()
def ardupilot(
    source: Source = None,
    state: State = None,
    home: Place = None,
    env: Environment = None,
    speed: Speed = 1.0,
    instance: Instance = 0,
    port: Port = None,
    defaults: Defaults = None,
    run: Run = None,
    robot: RobotId = "drone",
) -> None:
    """Start ArduCopter in simulation, and end it by Ctrl-C.

    It is found by `--from`, by AERODAAS_ARDUPILOT, or on PATH (`arducopter`).

        aerodaas sim ardupilot --from ~/ardupilot
        aerodaas sim ardupilot --home 47.3977,8.5456,488,90 --defaults gripper.parm
        aerodaas sim ardupilot --env apps/environments/farm.json --run apps/farm_survey.py
    """
    where = _home(home, env)
    with _state(state) as folder:
        _simulate(
            "ardupilot",
            {
                "state": folder,
                "source": source,
                "home": where,
                "speed": speed,
                "instance": instance,
                "port": port,
                "defaults": [one.resolve() for one in _files(defaults)],
            },
            run,
            robot,
        )


@app.command()
def px4(
    source: Source = None,
    state: State = None,
    home: Place = None,
    env: Environment = None,
    speed: Speed = 1.0,
    instance: Instance = 0,
    run: Run = None,
    robot: RobotId = "drone",
) -> None:
    """Start PX4 with its simulation in hardware (SIH), and end it by Ctrl-C.

    It is found by `--from`, by AERODAAS_PX4, or on PATH (`px4`).

        aerodaas sim px4 --from ~/PX4-Autopilot
        aerodaas sim px4 --instance 1 --run my_app.py
    """
    where = _home(home, env)
    with _state(state) as folder:
        options = {"state": folder, "source": source, "home": where}
        _simulate("px4", {**options, "speed": speed, "instance": instance}, run, robot)


def _simulate(family: Family, options: dict[str, object], run: Path | None, robot: str) -> None:
    from aerodaas.extensions.sitl.process import SitlOptions, SitlProcess  # noqa: PLC0415 - slow

    if run is not None and not run.is_file():
        raise ConfigError(f"there is no application {run}")
    simulator = SitlProcess(family, SitlOptions(**options))  # type: ignore[arg-type]
    signal.signal(signal.SIGTERM, _interrupt)
    code = 0
    with contextlib.suppress(KeyboardInterrupt), simulator:
        _print_instructions(simulator, robot)
        if run is None:
            simulator.wait()
        else:
            code = _flown(simulator, [str(run), *_settings(simulator, robot)])
    raise typer.Exit(code)


def _print_instructions(simulator: SitlProcess, robot: str) -> None:
    typer.echo(f"{simulator.program.command[0]} flies; what it prints is in {simulator.log}")
    typer.echo(f"Its vehicle is {simulator.url}. In another terminal:\n")
    typer.echo(f"  aerodaas run my_app.py {' '.join(_settings(simulator, robot))}\n")
    typer.echo("Ctrl-C ends it.")


def _settings(simulator: SitlProcess, robot: str) -> list[str]:
    """Options of `aerodaas run` by which a robot is the simulated vehicle."""
    return ["--set", f"{robot}.driver=mavlink", "--set", f"{robot}.url={simulator.url}"]


def _flown(simulator: SitlProcess, words: Sequence[str]) -> int:
    """Fly an application to its end; returns its exit code."""
    command = [sys.executable, "-m", "aerodaas", "run", *words]
    with subprocess.Popen(command) as flight:  # noqa: S603 - this project's own command
        try:
            while (code := flight.poll()) is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    flight.wait(0.5)
                simulator.require_alive()
        except SourceError as error:
            typer.echo(error, err=True)
            # The application meets a vehicle that is lost, and ends by its own rules.
            code = flight.wait() or 1
        except KeyboardInterrupt:
            # The terminal has told the application, too, which lands first.
            code = flight.wait()
    return code


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@contextlib.contextmanager
def _state(given: Path | None) -> Iterator[Path]:
    if given is not None:
        yield given.resolve()
        return
    with tempfile.TemporaryDirectory(prefix="aerodaas-sim-") as folder:
        yield Path(folder)


def _files(defaults: Sequence[Path] | None) -> Sequence[Path]:
    for one in defaults or ():
        if not one.is_file():
            raise ConfigError(f"there is no file of parameters {one}")
    return defaults or ()


def _home(text: str | None, env: Path | None) -> SimulatedHome:
    """The place that the command line names, the environment's, or one at Zurich."""
    from aerodaas.extensions.sitl.process import SimulatedHome  # noqa: PLC0415

    if text is not None:
        try:
            numbers = [float(part) for part in text.split(",")]
            place = SimulatedHome(*numbers)
        except (TypeError, ValueError):
            numbers, place = [], SimulatedHome()
        north_pole, date_line, least = 90.0, 180.0, 2
        if (
            len(numbers) < least
            or not abs(place.latitude) <= north_pole
            or not abs(place.longitude) <= date_line
            or not all(abs(one) < float("inf") for one in numbers)
        ):
            raise ConfigError(f"--home is LAT,LON[,ALT[,HEADING]] in degrees and m, not {text!r}")
        return place
    if env is None:
        return SimulatedHome()
    from aerodaas.config.model import EnvironmentConfig  # noqa: PLC0415 - slow to load

    home = EnvironmentConfig.load(env).home
    if home is None:
        raise ConfigError(f"{env} has no home: give --home")
    height = home.altitude if home.above_sea is None else home.above_sea
    return SimulatedHome(home.latitude, home.longitude, height)
