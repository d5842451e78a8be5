"""Members of a run: whether the clock of an actor's machine agrees with ours."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.actors.base import ActorInfo
from aerodaas.actors.run import actor_state, flight
from aerodaas.actors.run.actor_state import require_clock
from aerodaas.actors.run.flight import Flight
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import MissionError


def _info(clock: float) -> ActorInfo:
    return ActorInfo("node", 1, True, (), (), round(clock * NANOSECONDS))  # noqa: FBT003


@pytest.mark.parametrize(
    ("clock", "said"),
    [(98.9, "1 s behind"), (99.1, None), (102.0, None), (105.9, None), (106.1, "1 s ahead of")],
)
def test_a_clock_is_read_between_call_and_answer(
    monkeypatch: pytest.MonkeyPatch, clock: float, said: str | None
) -> None:
    """Called at 100 s and answered at 105 s by our clock, with a second's tolerance."""
    monkeypatch.setattr(actor_state, "host_time_ns", lambda: 105 * NANOSECONDS)
    if said is None:
        require_clock("drone", _info(clock), 100 * NANOSECONDS)
    else:
        with pytest.raises(MissionError, match=said):
            require_clock("drone", _info(clock), 100 * NANOSECONDS)


def test_calls_that_take_long_are_no_fault_of_a_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine needs 3 s to call two actors, the first of which is ready at once."""
    now = [100.0]
    infos: dict[Any, ActorInfo] = {}

    def call(name: str) -> str:
        infos[name] = _info(now[0])
        now[0] += 1.5
        return name

    def one(name: str) -> Any:  # noqa: ANN401
        remote = SimpleNamespace(remote=lambda: call(name))
        return SimpleNamespace(name=name, setup=(), handle=SimpleNamespace(prepare=remote))

    for module in (actor_state, flight):
        monkeypatch.setattr(module, "host_time_ns", lambda: round(now[0] * NANOSECONDS))
    monkeypatch.setattr("ray.wait", lambda waiting, timeout: (waiting[:1], timeout))
    monkeypatch.setattr(flight, "ask", infos.get)
    monkeypatch.setattr(Flight, "_connect", lambda *_: None)
    ready: list[str] = []
    bare = object.__new__(Flight)
    bare._members = {name: one(name) for name in ("drone", "camera")}
    Flight._prepare(bare, ready.append)
    assert ready == ["drone", "camera"]
