"""The age of the frames that are handed out, beside djitellopy on the same stream.

python benchmarks/tello.py --djitellopy /path/to/another/environment/bin/python

An emulated Tello streams a picture with its own time written into it to both readers at once,
each in a process of its own; the age of the newest frame is taken each time that it is asked for.
djitellopy brings another OpenCV, so that it needs an environment of its own.
"""

from __future__ import annotations

import json as json_format
import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from _ports import free_port
from _report import Report

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.errors import AeroDaaSError
from aerodaas.extensions.tello.vehicle import TelloVehicle

UNITS = {"median": "ms", "p99": "ms", "largest": "ms", "cpu": "% of a core", "frames": "asked for"}
_HERE = Path(__file__).resolve().parent
_START = 60.0
"""Seconds that readers may take to start on a busy host."""


def main(
    djitellopy: Annotated[
        Path | None,
        typer.Option(
            help="Python of an environment with djitellopy.", envvar="AERODAAS_DJITELLOPY"
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Time measured.", min=1.0)] = 20.0,
    rate: Annotated[float, typer.Option(help="Frames asked for per second.", min=1.0)] = 20.0,
    width: Annotated[int, typer.Option(help="Pixels.")] = 1280,
    height: Annotated[int, typer.Option(help="Pixels.")] = 720,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Compare the age of frames and the CPU that reading them takes."""
    report = Report("tello", UNITS, packages=["av", "opencv-python-headless"])
    report.note(
        f"{width} x {height} at 30 frames per second, H.264 over loopback; the newest frame is "
        f"asked for {rate:g} times a second, from two seconds after the first on. The age counts "
        "from the picture's making, before encoding."
    )
    ours, theirs = free_port(), free_port()
    readers = {"ours": [sys.executable, str(_HERE / "_tello_ours.py"), str(ours)]}
    if djitellopy is not None:
        script = str(_HERE / "_tello_djitellopy.py")
        readers["djitellopy"] = [str(djitellopy), script, str(theirs)]
    else:
        report.note("djitellopy was not measured: give --djitellopy.")
    try:
        for case, found in _measure(readers, ours, theirs, (width, height), seconds, rate).items():
            ages = found["ages"]
            report.row(
                case,
                {
                    "median": float(np.median(ages)),
                    "p99": float(np.percentile(ages, 99)),
                    "largest": max(ages),
                    "cpu": 100 * found["cpu"],
                    "frames": len(ages),
                },
            )
            if found["unreadable"]:
                report.note(f"{case}: {found['unreadable']} frames were torn or missing.")
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    report.show()
    if json is not None:
        report.write(json)


def _measure(
    readers: dict[str, list[str]],
    ours: int,
    theirs: int,
    size: tuple[int, int],
    seconds: float,
    rate: float,
) -> dict[str, dict[str, Any]]:
    tello = _start(
        [
            *(sys.executable, "-m", "tools.tello_vehicle", "--port", "0", "--source", "clock"),
            *("--width", str(size[0]), "--height", str(size[1]), "--copy-to", str(theirs)),
        ]
    )
    assert tello.stdout is not None  # noqa: S101 - asked for a pipe
    processes = [tello]
    try:
        port = int(tello.stdout.readline().rpartition(":")[2])
        vehicle = _connected(port, ours)
        running = {
            case: _start([*command, str(seconds), str(rate)]) for case, command in readers.items()
        }
        processes += running.values()
        found = {
            case: json_format.loads(process.communicate(timeout=seconds + _START)[0])
            for case, process in running.items()
        }
        vehicle.close()
        return found
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _connected(port: int, video: int) -> TelloVehicle:
    """A vehicle that has connected and switched the stream on."""
    robot = RobotConfig.model_validate(
        {
            "id": "tello",
            "driver": "tello",
            "settings": {
                "address": "127.0.0.1",
                "command_port": port,
                "state_port": free_port(),
            },
            "sensors": [{"id": "camera", "settings": {"video_port": video}}],
        }
    )
    vehicle = TelloVehicle(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect(30.0)
    return vehicle


def _start(command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603 - our own
        command,
        stdout=subprocess.PIPE,
        text=True,
        cwd=_HERE.parent,
        env={**os.environ, "PYTHONPATH": str(_HERE.parent), "PYTHONUNBUFFERED": "1"},
    )


if __name__ == "__main__":
    typer.run(main)
