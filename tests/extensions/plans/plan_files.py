"""Plan files as ground stations write them, made up."""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["HOME", "item", "lines", "mavwp", "plan", "survey", "waypoint"]

mavwp: Any = importlib.import_module("pymavlink.mavwp")
"""pymavlink's own reader and writer of waypoint files. It has no types."""

HOME = (47.0, 8.0, 488.0)


def item(command: int, params: Sequence[Any], frame: Any = 3, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """A simple item."""
    fixed = {"type": "SimpleItem", "autoContinue": True, "command": command, "doJumpId": 1}
    return fixed | {"frame": frame, "params": list(params)} | more


def waypoint(north: float, height: float = 20.0, frame: int = 3, hover: float = 0.0) -> Any:  # noqa: ANN401
    """A waypoint, degrees north of home."""
    return item(16, [hover, 0, 0, None, 47.0 + north, 8.0, height], frame)


def survey(*items: dict[str, Any], kind: str = "survey") -> dict[str, Any]:
    """A complex item that was turned into these."""
    inner = {"Items": list(items), "FollowTerrain": False}
    return {"type": "ComplexItem", "complexItemType": kind, "TransectStyleComplexItem": inner}


def plan(path: Path, *items: dict[str, Any], home: Any = HOME, **more: Any) -> Path:  # noqa: ANN401
    """Write a `.plan` of these items; `more` are keys of the file, `mission` of its mission."""
    mission = {"version": 2, "plannedHomePosition": home, "items": list(items), "firmwareType": 12}
    content = {"fileType": "Plan", "version": 1, "mission": mission | more.pop("mission", {})}
    path.write_text(json.dumps(content | more))
    return path


def lines(path: Path, *rows: str, home: str = "47.0 8.0 488.0") -> Path:
    """Write a `.waypoints` file: each row is frame, command, four values and a place."""
    numbered = [f"0 1 0 16 0 0 0 0 {home} 1", *[f"{i} 0 {r} 1" for i, r in enumerate(rows, 1)]]
    fields = [row.replace(" ", "\t") for row in numbered]
    path.write_text("\n".join(["QGC WPL 110", *fields, ""]))
    return path
