"""The terminal view, on terminals of all kinds and on none."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from aerodaas.messages.mission import BatteryOutlook, MissionState, MissionStatus, RobotStatus
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.terminal.live import MissionView
from aerodaas.terminal.panels import Snapshot, StreamSnapshot


def snapshot(
    time: float, state: MissionState = MissionState.ENROUTE, alerts: tuple[str, ...] = ()
) -> Snapshot:
    """A drone on its way north."""
    target = Waypoint("[/north]", 0.0, 10.0, 1.5)
    mission = MissionStatus(
        0,
        state,
        "to [north]",
        target,
        (Waypoint("east", 10.0, 0.0, 1.5),),
        ("start",),
        visits=1,
        waypoint_counts=(1, 3),
        outlook=BatteryOutlook(plan=0.614, returns_at=0.27, hover=65.4),
    )
    odometry = Odometry(np.array([-0.01, time, 1.5]), np.array([0.0, 1.0, 0.0]), 1.57)
    vehicle = VehicleState(0, odometry, Battery(0.5), VehicleMode.GUIDED, armed=True)
    streams = (StreamSnapshot("tello/camera", 14.9, 2.0, 3.0, 7), StreamSnapshot("tello/follow"))
    return Snapshot(
        "Farm [Survey]",
        time,
        time / 10,
        {"tello": RobotStatus(mission, vehicle)},
        streams,
        alerts,
    )


def drawn(width: int, encoding: str = "utf-8") -> str:
    """The panel as a terminal of this width and encoding receives it."""
    raw = io.BytesIO()
    console = Console(
        file=io.TextIOWrapper(raw, encoding=encoding),
        width=width,
        force_terminal=True,
        color_system=None,
        legacy_windows=False,
    )
    with MissionView(console) as view:
        for time in range(6):
            now = snapshot(float(time), alerts=("battery_low: at 20 %",))
            view.update(replace(now, scheduler="Dems: 93 % of 120 in time"))
    console.file.flush()
    return raw.getvalue().decode(encoding)


@pytest.mark.parametrize("width", [80, 100, 200])
def test_panel_shows_what_matters(width: int) -> None:
    """State, waypoint, position, battery, rates, latency, drops, alerts, time and speed."""
    text = drawn(width)
    for words in (
        "Farm [Survey]",
        "ENROUTE",
        "to [north]",
        "[/north] (0.0, 10.0, 1.5), 5.0 m away",
        "E 0.0  N 5.0  up 1.5 m, 1.0 m/s",
        "50 %",
        "returns at 27%, in 1:05; plan needs 61%",
        "1 of 3 waypoints",
        "14.9",
        "Dems: 93 % of 120 in time",
        "battery_low: at 20 %",
        "mission 0:05.0",
        "10.0x real time",
    ):
        assert words in text


@pytest.mark.parametrize("width", [72, 80])
def test_a_narrow_panel_cuts_no_name(width: int) -> None:
    """Streams, reasons, faults and alerts go on in the next line."""
    long = "drone/a_stream_with_a_name_that_tells_all_that_it_is_made_from"
    alert = "link_lost: " + " ".join(f"word{number}" for number in range(30))
    told = snapshot(3.0, alerts=(alert,))
    robot = told.robots["tello"]
    reason = " ".join(f"reason{number}" for number in range(20))
    mission = replace(robot.mission, reason=reason, faults=(alert,))
    told = replace(
        told, robots={"tello": replace(robot, mission=mission)}, streams=(StreamSnapshot(long),)
    )
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    console.print(MissionView(console).render(told))
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "…" not in text
    assert all(word in text for word in (*alert.split(), *reason.split()))


def test_a_dumb_terminal_gets_lines() -> None:
    """It cannot draw over what it has drawn."""
    out = io.StringIO()
    console = Console(file=out, force_terminal=True, _environ={"TERM": "dumb"})
    with MissionView(console) as view:
        view.update(snapshot(1.0))
        assert not view.live
    assert "\x1b" not in out.getvalue()
    assert "tello enroute" in out.getvalue()


@pytest.mark.parametrize("width", [40, 80])
def test_panel_keeps_to_the_width(width: int) -> None:
    """No line wraps."""
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    console.print(MissionView(console).render(snapshot(3.0)))
    assert isinstance(console.file, io.StringIO)
    assert max(len(line) for line in console.file.getvalue().splitlines()) <= width


def test_panel_on_a_terminal_without_unicode() -> None:
    """A serial console gets ASCII."""
    text = drawn(80, "ascii")
    assert "ENROUTE" in text
    assert "50 %" in text


def test_a_pipe_is_not_told_twice_what_was_heard_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever looks again and again at a provider that is gone gets one line; then new ones."""
    clock = itertools.count(step=10.0)
    monkeypatch.setattr("aerodaas.terminal.live.time.monotonic", lambda: next(clock))
    out = io.StringIO()
    with MissionView(Console(file=out, width=200)) as view:
        for heard in (4.0, 4.0, 4.0, 5.0):
            view.update(snapshot(heard))
        lines = out.getvalue().splitlines()
    assert [line.split(" s]")[0] for line in lines] == ["[    4.0", "[    5.0"]


def test_pipe_gets_a_line_at_each_change_of_state() -> None:
    """No control characters, no flood: between changes only the clock makes lines."""
    out = io.StringIO()
    with MissionView(Console(file=out, width=80)) as view:
        for time in range(50):
            view.update(snapshot(time / 10))
        view.update(snapshot(5.0, MissionState.LOITERING))
    lines = out.getvalue().splitlines()
    assert "\x1b" not in out.getvalue()
    assert len(lines) == 2
    assert lines[0].startswith("[    0.0 s] tello enroute: to [north], E 0.0  N 0.0  up 1.5 m")
    assert "loitering" in lines[1]


def test_nothing_known_yet() -> None:
    """Before the first status of a robot there is a picture already."""
    console = Console(file=io.StringIO(), width=80, force_terminal=True)
    with MissionView(console) as view:
        view.update(Snapshot("Farm", 0.0, 0.0))
    assert isinstance(console.file, io.StringIO)
    assert "Farm" in console.file.getvalue()
