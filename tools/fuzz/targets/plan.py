"""QGroundControl's `.plan` files, as navigation is made from them."""

from __future__ import annotations

import atexit
import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from aerodaas.drivers.mavlink.plan_file import read_plan
from aerodaas.types.errors import AeroDaaSError
from aerodaas.types.geometry import GeodeticOrigin

__all__ = ["run", "seeds"]

_HOME = GeodeticOrigin(47.0, 8.0, 488.0)
_FILE, _NAME = tempfile.mkstemp(suffix=".plan")
os.close(_FILE)
atexit.register(Path(_NAME).unlink, missing_ok=True)


def seeds() -> Iterable[bytes]:
    """A plan of simple items and a survey."""
    items = [
        _item(22, [15.0, 0.0, 0.0, None, 47.0, 8.0, 10.0]),
        _item(178, [1, 5.0, -1, 0, 0, 0, 0]),
        _item(16, [2.0, 0.0, 0.0, 90.0, 47.0001, 8.0002, 12.5]),
        _item(82, [0.0, 0.0, 0.0, None, 47.0002, 8.0002, 500.0], frame=0),
        _item(19, [4.0, 0.0, 5.0, 0.0, 47.0001, 8.0001, 9.0]),
        _item(20, [0, 0, 0, 0, 0, 0, 0]),
    ]
    yield _plan(items)
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": items[2:4]},
    }
    yield _plan([items[0], survey, items[-1]])


def run(data: bytes) -> None:
    """Read one plan; waypoints check their own numbers."""
    Path(_NAME).write_bytes(data)
    try:
        read_plan(_NAME, _HOME)
    except AeroDaaSError:
        return


def _item(command: int, params: list[float | None], frame: int = 3) -> dict[str, object]:
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": command,
        "doJumpId": 1,
        "frame": frame,
        "params": params,
    }


def _plan(items: Sequence[Mapping[str, object]]) -> bytes:
    content = {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "mission": {
            "items": items,
            "plannedHomePosition": [47.0, 8.0, 488.0],
            "version": 2,
        },
    }
    return json.dumps(content).encode()
