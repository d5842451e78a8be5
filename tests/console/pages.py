"""What the tests of the console's page do with it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from aerodaas.recording.reader import Recording
from tools.browser import Page

__all__ = ["button", "click_map", "passed", "until_done", "until_state"]

_NEAR = 0.8
"""Metres from a place at which the drone was there."""


def until_state(page: Page, *states: str) -> None:
    """Wait until the page says that the drone is in one of these states."""
    page.until(
        f"{json.dumps(states)}.includes(document.querySelector('[data-testid=state]')?.innerText)"
    )


def click_map(page: Page, east: float, north: float) -> None:
    """Click a place of the map."""
    x, y = page.run(
        "(map => { const box = map.getBoundingClientRect(); const of = map.dataset; return ["
        f"box.x + box.width / 2 + ({east} - of.east) * of.scale,"
        f"box.y + box.height / 2 - ({north} - of.north) * of.scale]; }})"
        "(document.querySelector('[data-testid=map]'))"
    )
    page.click(x, y)


def button(name: str) -> str:
    """Script that presses a button of the commands, which may not be disabled."""
    return f"document.querySelector('.command.{name}:not(:disabled)').click()"


def until_done(page: Page, what: str) -> None:
    """Wait until the newest order is this one, and was seen to be carried out."""
    page.until(
        f"(one => one?.dataset.stage === 'done' && one.innerText.startsWith({json.dumps(what)}))"
        "(document.querySelector('.orders li'))"
    )


def passed(path: Path, place: tuple[float, float]) -> bool:
    """Whether the drone was at a place, by the simulator's own truth."""
    with Recording.open(path) as recording:
        truths = [
            record.value.truth.position[:2]
            for record in recording.records(schemas=["aerodaas.VehicleState"])
            if record.value.truth is not None
        ]
    return bool(np.linalg.norm(np.array(truths) - place, axis=1).min() < _NEAR)
