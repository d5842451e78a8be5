"""The view of a flight at a provider."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import pytest
from provider_stub import mission, status

from aerodaas.messages.mission import MissionState
from aerodaas.protocol.schemas import MissionPhase
from aerodaas.terminal.provided import ProvidedView, phase_text


def test_a_pipe_gets_a_line_for_each_robot(capsys: pytest.CaptureFixture[str]) -> None:
    """State, place and charge, as of a flight of one's own; alerts once."""
    with ProvidedView(shown=True) as view:
        view.update(mission(alerts=["low battery"]))
        view.show_message("the connection is lost")
    captured = capsys.readouterr()
    assert "drone enroute: flying to a, E 1.0  N 0.0  up 2.0 m, battery 90 %" in captured.out
    assert captured.err.count("low battery") == 1
    assert "the connection is lost" in captured.err


def test_what_is_unknown_is_shown_as_such(capsys: pytest.CaptureFixture[str]) -> None:
    """A drone without a position, and one without a vehicle's state."""
    lost = status(position=(nan, nan, nan), battery=nan)
    early = replace(status(), vehicle=None)
    with ProvidedView(shown=True) as view:
        view.update(mission(status={"drone": lost, "other": early}))
    shown = capsys.readouterr().out
    assert "drone enroute" in shown
    assert "other enroute" in shown


def test_what_was_not_told_anew_is_called_old(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A provider repeats what it knows of a flight that hangs; who has landed tells no more."""
    now = 100.0
    monkeypatch.setattr("aerodaas.terminal.provided.time.monotonic", lambda: now)
    flying, landed = status(), status(state=MissionState.LANDED)
    with ProvidedView(shown=True) as view:
        view.update(mission(status={"one": flying, "two": landed}))
        now += 40.0
        view.update(mission(status={"one": flying, "two": landed}))
        old = capsys.readouterr().out.splitlines()
        now += 40.0
        view.update(mission(status={"one": status(time=80.0), "two": landed}))
    new = capsys.readouterr().out.splitlines()
    (told,) = [line for line in old if "no word" in line]
    assert "one enroute: no word from it for 40 s: this is old" in told
    assert not any("no word" in line for line in new)
    assert any("one enroute" in line for line in new)


def test_without_a_view_new_alerts_alone_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    """Each once, though the newest ones come with every state."""
    with ProvidedView(shown=False) as view:
        view.update(mission(alerts=["one"]))
        view.update(mission(alerts=["one", "two"]))
        view.update(mission(alerts=["two", "two"]))
    captured = capsys.readouterr()
    assert captured.err.split() == ["one", "two", "two"]
    assert captured.out == ""


@pytest.mark.parametrize("shown", [True, False])
def test_alerts_are_told_before_the_view_and_beyond_the_newest_fifty(
    capsys: pytest.CaptureFixture[str], *, shown: bool
) -> None:
    """A provider sends the newest fifty each time; each is told once, whoever looks."""
    texts = [f"alert {number}" for number in range(120)]
    view = ProvidedView(shown=shown)
    for end in range(1, 61):
        view.print_alerts(mission(alerts=texts[max(0, end - 50) : end]))
    with view:
        for end in range(60, 121):
            view.update(mission(alerts=texts[max(0, end - 50) : end]))
    assert capsys.readouterr().err.splitlines() == texts


def test_a_phase_is_told_with_its_reason() -> None:
    """In plain words."""
    waiting = mission(MissionPhase.QUEUED, reason="waits for its drones")
    assert phase_text(waiting) == "waits for its drones"
    refused = mission(MissionPhase.REFUSED, reason="it leaves the fence")
    assert phase_text(refused) == "refused: it leaves the fence"
