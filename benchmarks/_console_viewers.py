"""Viewers of a console for its benchmark: each takes state and pictures, as a page does.

`python benchmarks/_console_viewers.py URL COUNT SECONDS CAMERA FORM` prints pictures and bytes a
second and viewer; the pictures' form is `jpeg` or `h264`.
"""

from __future__ import annotations

import asyncio
import sys
import time

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

_MOST = 8 << 20


async def _take(url: str, token: str, until: float) -> tuple[int, int]:
    """Read until then; returns how many pictures came, of how many bytes."""
    pictures = size = 0
    headers = {"Authorization": f"Bearer {token}"}
    async with connect(url, additional_headers=headers, max_size=_MOST, proxy=None) as socket:
        try:
            while (left := until - time.monotonic()) > 0:
                message = await asyncio.wait_for(socket.recv(), left)
                if isinstance(message, bytes):
                    pictures += 1
                    size += len(message)
        except (TimeoutError, asyncio.TimeoutError, ConnectionClosed):
            pass
    return pictures, size


async def _all(address: str, count: int, seconds: float, camera: str, form: str) -> list[float]:
    base, _, token = address.partition("/#token=")
    live = f"{base.replace('http', 'ws', 1)}/v1/missions/own/live?rate="
    until = time.monotonic() + seconds
    viewers = [
        _take(f"{live}{query}", token, until)
        for _ in range(count)
        for query in ("10", f"1&streams={camera}&pictures={form}")
    ]
    took = await asyncio.gather(*viewers)
    return [sum(each) / count / seconds for each in zip(*took, strict=True)]


if __name__ == "__main__":
    _, where, number, span, name, form = sys.argv
    print(*asyncio.run(_all(where, int(number), float(span), name, form)))
