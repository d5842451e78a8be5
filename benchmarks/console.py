"""The console in a real browser: delay of its video and its commands, and what viewers cost.

    python benchmarks/console.py
    python benchmarks/console.py --seconds 3 --commands 4 --viewers 0 --viewers 5
    python benchmarks/console.py --pictures h264

flies a simulated drone with a camera of 1280 x 720 at 30 Hz in real time, and opens its console in
the browser that is installed (AERODAAS_BROWSER names another one).
"""

from __future__ import annotations

import gzip
import json as json_format
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any
from unittest.mock import patch

import numpy as np
import psutil
import typer
from _recording_app import RATE, SIZE, Seen, draw_pictures, environment
from _report import Report

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from aerodaas.config.options import RunOptions, current_options
from aerodaas.protocol.schemas import COMMANDS
from aerodaas.recording.reader import Recording
from aerodaas.service.http import page as console_page
from tools.browser import Browser, Page

UNITS = {"median": "", "p99": "", "count": ""}
CAMERA = "drone0/camera0"
_FAR = 350.0
"""Metres to a waypoint that is not reached while anything is measured."""
_SETTLE = 2.0
_PAGE = Path(console_page.__file__).parent / "page"
_WATCH_VIDEO = """(() => {
  window.delays = [];
  const screen = document.querySelector('[data-testid=video]');
  new MutationObserver(() => {
    const now = performance.timeOrigin + performance.now();
    window.delays.push(now - screen.dataset.captured / 1e6);
  }).observe(screen, {attributeFilter: ['data-captured']});
})()"""
_WATCH_FIRST_VIEW = """
  new MutationObserver((_, watch) => {
    if (!document.querySelector('[data-drone]')) return;
    watch.disconnect();
    requestAnimationFrame(() => { window.firstView = performance.now(); });
  }).observe(document, {childList: true, subtree: true});
"""
_CLICK = """(button => {{
  const at = performance.timeOrigin + performance.now(); button.click(); return at;
}})(document.querySelector('.command.{}:not(:disabled)'))"""


def main(
    seconds: Annotated[float, typer.Option(help="Of each measurement.", min=1)] = 15.0,
    commands: Annotated[int, typer.Option(help="Commands that are clicked.", min=2)] = 30,
    viewers: Annotated[list[int] | None, typer.Option(help="Numbers of viewers.", min=0)] = None,
    pictures: Annotated[str, typer.Option(help="Their form: jpeg or h264.")] = "jpeg",
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly, look on and command.

    "captured to drawn" is until the page has drawn a picture on its canvas, not until it lights
    up; "click to setpoint" until the drone's controller has sent another setpoint, by the
    recording. "drone's cores" are those of the actors and Ray, "server's cores" those of the
    application's own process, which serves the console and encodes its pictures. A viewer takes
    the state ten times a second and every picture that it can.
    """
    report = Report("console", UNITS, packages=["ray", "starlette", "uvicorn", "websockets"])
    report.note(f"Camera of {SIZE[0]} x {SIZE[1]} at {RATE:g} Hz, recorded as JPEG.")
    report.note(f"Pictures go to the browser as {pictures}.")
    report.note(f"{psutil.getloadavg()[0]:.1f} processes wanted to run when it began.")
    with tempfile.TemporaryDirectory() as temporary:
        _fly(Path(temporary), report, seconds, commands, viewers or [0, 1, 50, 200], pictures)
    sizes = [len(gzip.compress(path.read_bytes(), 9)) for path in _PAGE.glob("[ci]*.*")]
    report.row("page, gzip, kB", _row([sum(sizes) / 1e3]))
    report.show()
    if json is not None:
        report.write(json)


def _fly(
    folder: Path, report: Report, seconds: float, commands: int, viewers: list[int], form: str
) -> None:
    content = environment(1, draw_pictures(folder / "pictures"), recorded=True)
    path = folder / "environment.json"
    path.write_text(json_format.dumps(content))
    options = RunOptions(
        record=folder / "recorded",
        view=False,
        speed=1.0,
        simulated_time=False,
        console="127.0.0.1:0",
    )
    token = current_options.set(options)
    try:
        with (
            patch("aerodaas.terminal.console.show_results"),
            patch("aerodaas.terminal.console.show_console") as told,
        ):
            env = Environment(path)
            _build(env)
            run = env.launch()
            # The clock's zero, which the recording does not have.
            origin = run._flight._origin  # type: ignore[union-attr] # noqa: SLF001 - as above
            address: str = told.call_args.args[0]
            try:
                clicked = _look_on(address, report, seconds, commands, viewers, form)
            finally:
                run.command("drone0", COMMANDS["land"])
                run.wait()
    finally:
        current_options.reset(token)
    setpoints = _changes(folder / "recorded" / "flight.mcap")
    delays = [
        next((at for at in setpoints if at > click - origin / 1e6), np.nan) - click + origin / 1e6
        for click in clicked
    ]
    report.rows.insert(1, ("click to setpoint, ms", _row(delays)))


def _build(env: Environment) -> None:
    """The drone flies off, slowly."""
    drone = env.get_robot_by_id("drone0")
    Seen().analyse(drone.get_sensor_by_id("camera0").get_data_stream())
    far = Waypoint("far", 0, _FAR, 2.0, waypoint_type="local")
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [far]))


def _look_on(
    address: str, report: Report, seconds: float, commands: int, viewers: list[int], form: str
) -> list[float]:
    """Measure in flight; returns when commands were clicked, Unix milliseconds."""
    loads = {count: _load(address, count, seconds, form) for count in viewers}
    with Browser() as browser:
        page = browser.open("about:blank")
        page.before(_WATCH_FIRST_VIEW)
        address += f"&pictures={form}"
        page.go(address)
        page.until("window.firstView")
        first = [page.run("window.firstView")]
        page.until("document.querySelector('[data-testid=video]')?.dataset.captured > 0")
        time.sleep(_SETTLE)
        page.run(_WATCH_VIDEO)
        time.sleep(seconds)
        report.row("captured to drawn, ms", _row(page.run("window.delays")))
        clicked = list(_clicks(page, commands))
        for _ in range(2):
            page.go("about:blank")
            page.go(address)
            page.until("window.firstView")
            first.append(page.run("window.firstView"))
    report.row("first view of the page, ms", _row(first))
    for count, (drone, server, pictures, size) in loads.items():
        report.row(f"drone's cores with {count} viewers", _row([drone]))
        report.row(f"server's cores with {count} viewers", _row([server]))
        if count:
            report.note(
                f"{count} viewers got {pictures:.1f} pictures a second each, {size / 1e6:.2f} MB."
            )
    return clicked


def _clicks(page: Page, commands: int) -> Any:  # noqa: ANN401 - numbers
    for number in range(commands):
        word, state = ("pause", "paused") if number % 2 == 0 else ("resume", "enroute")
        page.until(f"document.querySelector('.command.{word}:not(:disabled)')")
        # Not always at the same place in the controller's period.
        time.sleep(0.3 + 0.017 * (number % 7))
        yield page.run(_CLICK.format(word))
        page.until(f"document.querySelector('[data-testid=state]').innerText === '{state}'")


def _changes(path: Path) -> list[float]:
    """Mission milliseconds at which another place was asked for than before."""
    found, before = [], None
    with Recording.open(path) as recording:
        for record in recording.records(schemas=("aerodaas.Setpoint",)):
            asked = record.value.asked
            if asked != before:
                found.append(record.stamp / 1e6)
            before = asked
    return found


def _load(
    address: str, viewers: int, seconds: float, form: str
) -> tuple[float, float, float, float]:
    """Cores of the drone's side and the server's; pictures and bytes a second and viewer."""
    watching = None
    if viewers:
        script = str(Path(__file__).with_name("_console_viewers.py"))
        words = [script, address, str(viewers), str(seconds + 2 * _SETTLE), CAMERA, form]
        watching = subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True)  # noqa: S603 - ours
    time.sleep(_SETTLE)
    others = {watching.pid} if watching is not None else set()
    before, began = _busy(others), time.monotonic()
    time.sleep(seconds)
    took = time.monotonic() - began
    drone, server = ((now - then) / took for now, then in zip(_busy(others), before, strict=True))
    said = watching.communicate()[0] if watching is not None else "0 0"
    pictures, size = map(float, said.split())
    return drone, server, pictures, size


def _busy(others: set[int]) -> tuple[float, float]:
    """Seconds of processor time of this process' children but `others`, and of itself, so far."""
    own = psutil.Process()
    children = [one for one in own.children(recursive=True) if one.pid not in others]
    return sum(map(_taken, children)), _taken(own)


def _taken(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _row(values: list[float]) -> dict[str, float]:
    known = np.array(values, dtype=float)
    if len(known) == 1:
        return {"median": known[0], "p99": np.nan, "count": 1}
    return {
        "median": float(np.nanmedian(known)),
        "p99": float(np.nanpercentile(known, 99)),
        "count": int(np.isfinite(known).sum()),
    }


if __name__ == "__main__":
    typer.run(main)
