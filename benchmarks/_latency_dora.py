"""One of the four nodes of the latency benchmark in dora: `… camera|read|steer|drone`.

The frame's capture stamp travels in its first eight bytes and then as an integer, so that the
drone's node knows how old the command is.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
from dora import Node

WIDTH, HEIGHT = 1280, 720


def camera(node: Node) -> None:
    """Publish a frame at every tick."""
    image = np.random.default_rng(0).integers(0, 255, HEIGHT * WIDTH * 3, dtype=np.uint8)
    frames = int(os.environ["LATENCY_FRAMES"])
    for event in node:
        if event["type"] != "INPUT":
            continue
        image[:8].view(np.int64)[0] = time.monotonic_ns()
        node.send_output("frame", pa.array(image))
        frames -= 1
        if frames == 0:
            return


def read(node: Node) -> None:
    """Sum a share of the pixels."""
    for event in node:
        if event["type"] == "INPUT":
            image = event["value"].to_numpy(zero_copy_only=True)
            total = int(image[::64].sum(dtype=np.int64))
            stamp = int(image[:8].view(np.int64)[0])
            node.send_output("reading", pa.array([stamp, total]))


def steer(node: Node) -> None:
    """Turn each reading into a velocity command."""
    for event in node:
        if event["type"] == "INPUT":
            stamp = event["value"][0].as_py()
            node.send_output("command", pa.array([stamp, 0, 0, 0, 0]))


def drone(node: Node) -> None:
    """Note how old each command is."""
    ages = [
        (time.monotonic_ns() - event["value"][0].as_py()) / 1e6
        for event in node
        if event["type"] == "INPUT"
    ]
    Path(os.environ["LATENCY_RESULT"]).write_text(json.dumps(ages), encoding="utf-8")


if __name__ == "__main__":
    {"camera": camera, "read": read, "steer": steer, "drone": drone}[sys.argv[1]](Node())
