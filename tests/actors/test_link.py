"""Between two Ray nodes of this machine: a frame crosses once, and the link is measured."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

PROGRAM = Path(__file__).with_name("link_nodes.py")
FRAMES = 12


@pytest.mark.slow
def test_a_frame_crosses_the_link_once_for_two_analyses() -> None:
    """As many bytes as the frames have, though two analyses there work on each."""
    done = subprocess.run(
        [sys.executable, str(PROGRAM)], capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert told["here"]
    assert told["answered"] == 2 * FRAMES
    site = told["sites"]["cloud"]
    assert (site["codec"], site["frames"]) == ("raw", FRAMES)
    picture = 640 * 360 * 3 / 1e6
    assert FRAMES * picture < site["sent_mb"] < (FRAMES + 1) * picture
    assert site["latency_ms"] > 0
    assert 0 < site["bandwidth_mbit"] < float("inf")
