"""What a run prints before, while and after it flies, where no panel is drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert
from aerodaas.runtime.reports import ActorReport, FlightState
from aerodaas.terminal.console import FlightView, StartupView, show_left, show_results

CONFIG = EnvironmentConfig.model_validate({"name": "flat", "robots": [{"id": "drone"}]})


def alert(number: int, text: str, source: str = "drone/drone") -> Alert:
    """An alert of second `number`."""
    return Alert(Header(number, number * NANOSECONDS, source), "kind", text)


def state(*alerts: Alert, notes: tuple[Alert, ...] = ()) -> FlightState:
    """A flight whose drone's actor has told these."""
    reports = {"drone/drone": ActorReport("running", alerts=alerts)}
    return FlightState({}, reports, over=False, notes=notes)


@pytest.mark.parametrize("shown", [True, False])
def test_alerts_are_told_once_whether_or_not_somebody_waits(
    capsys: pytest.CaptureFixture[str], *, shown: bool
) -> None:
    """Before the view is entered, while it is, and after it: more of them than a panel holds."""
    alerts = [alert(number, f"text {number}") for number in range(12)]
    view = FlightView(RunOptions(view=shown), CONFIG)
    view.print_alerts(state(*alerts[:2]))
    with view:
        for end in range(2, 12):
            now = state(*alerts[:end])
            view.print_alerts(now)
            view.update(now)
    view.print_alerts(state(*alerts))
    told = capsys.readouterr().err.splitlines()
    assert told == [f"{number}.0 s drone/drone: text {number}" for number in range(12)]


def test_an_alert_of_the_application_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    """Also where the drone that would repeat it hangs, and where two do."""
    view = FlightView(RunOptions(view=False), CONFIG)
    note = alert(3, "the recorder hangs", "application")
    view.print_alerts(state(notes=(note,)))
    view.print_alerts(state(alert(4, "the recorder hangs"), alert(5, "landed"), notes=(note,)))
    told = capsys.readouterr().err.splitlines()
    assert told == ["3.0 s application: the recorder hangs", "5.0 s drone/drone: landed"]


def test_a_pipe_is_told_what_takes_long_at_the_start(capsys: pytest.CaptureFixture[str]) -> None:
    """A line as it begins, once; nothing of each actor, and nothing where no view is wanted."""
    for shown in (True, False):
        with StartupView(RunOptions(view=shown)) as starting:
            starting.begin("starting Ray")
            starting.begin("starting Ray")
            starting.step("drone/drone")
            starting.begin("opening vehicles")
    assert capsys.readouterr().out.splitlines() == ["starting Ray …", "opening vehicles …"]


def test_a_recording_without_a_report_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever keeps the report from being written, such as a full disk."""
    parts = [tmp_path / name for name in ("flight.mcap", "flight.2.mcap")]
    for part in parts:
        part.touch()
    for options in (RunOptions(), RunOptions(report="figures")):
        show_results(options, parts)
        told = capsys.readouterr().out
        assert "no report: " in told
        assert all(str(part) in told for part in parts)


def test_all_files_of_a_flight_that_goes_on_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recorder that was started anew has begun a second one."""
    show_left([tmp_path / "flight.mcap", tmp_path / "flight.2.mcap"])
    told = capsys.readouterr().err
    assert "flight.mcap" in told
    assert "flight.2.mcap" in told
