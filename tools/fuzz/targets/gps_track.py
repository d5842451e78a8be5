"""Tracks of GPS loggers: GPX, CSV and JSON, as the external source reads them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable

from aerodaas.analytics.base import ComputeKind
from aerodaas.analytics.monitoring.gps_logger import GpsLoggerAnalytics
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.readings import Alert
from tools.fuzz.scratch import scratch_file

__all__ = ["run", "seeds"]

_FILE = scratch_file(".gps")


class _Context:
    """A minute into the mission."""

    kind: ComputeKind = "edge"

    def now(self) -> int:
        return 60 * 10**9

    def vehicle(self) -> None:
        return None

    def alert(self, alert: Alert) -> None:
        raise AssertionError(f"a file raises no alert: {alert}")


def seeds() -> Iterable[bytes]:
    """One track in each format, and in the spellings of several loggers."""
    points = "".join(
        f'<trkpt lat="47.00{i}" lon="8.00{i}"><ele>{480 + i}</ele>'
        f"<time>2025-05-01T10:00:0{i}.5Z</time><sat>9</sat></trkpt>"
        for i in range(4)
    )
    head = '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">'
    yield f"{head}<trk><trkseg>{points}</trkseg></trk></gpx>".encode()
    yield b"time,lat,lon,elevation,accuracy,satellites\n" + b"".join(
        b"2025-05-01T10:00:0%d,47.00%d,8.0,481.5,3.5,8\n" % (i, i) for i in range(4)
    )
    yield (
        b"# logger\nDate (UTC);Time (UTC);Latitude (deg);Longitude (deg)\n"
        b"2025/05/01;10:00:01;47.1;8.1\n2025/05/01;10:00:02;47.2;8.2\n"
    )
    rows = [{"timestamp": 1746093600000 + i, "lat": 47.0, "lng": 8.0, "alt": 4} for i in range(3)]
    yield json.dumps(rows).encode()
    yield json.dumps({"lat": 47.0, "lon": 8.0}).encode()


def run(data: bytes) -> None:
    """Read one track and play a minute of it; each fix lies on the globe."""
    _FILE.write_bytes(data)
    try:
        logger = GpsLoggerAnalytics(_FILE)
    except AeroDaaSError:
        return
    fix = logger.process(None, _Context())
    if fix is not None and not all(map(math.isfinite, (fix.latitude, fix.longitude, fix.altitude))):
        raise AssertionError(f"a fix at {fix}")
