"""GpsLoggerAnalytics: the fixes of a GPS log file (GPX, CSV, JSON) or HTTP feed as a stream."""

from __future__ import annotations

import bisect
import csv
import io
import json
import logging
import math
import re
import ssl
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar
from xml.etree import ElementTree as ET

from aerodaas.analytics.base import Analytics, Context, ResourceUse
from aerodaas.clock import seconds
from aerodaas.config.checked import Positive
from aerodaas.errors import ConfigError, SourceError
from aerodaas.http_client import http_client, http_errors, read_at_most
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import GpsFix
from aerodaas.messages.readings import Alert

if TYPE_CHECKING:
    import httpx

__all__ = ["GpsLoggerAnalytics", "GpsTrack", "TimedFix", "parse_track"]

_NAMES: Mapping[str, tuple[str, ...]] = {
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "lng", "long", "longitude"),
    "altitude": ("alt", "altitude", "ele", "elevation", "height"),
    "accuracy": ("accuracy", "acc", "hacc", "horizontalaccuracy"),
    "satellites": ("sat", "sats", "satellites", "satused"),
    "time": ("time", "timestamp", "datetime", "utctime", "timeutc", "utc", "dateandtime"),
    "date": ("date", "utcdate", "dateutc"),
}
_UNITS = re.compile(r"\((m|metres|meters|deg|degrees|utc)\)|\[[^][]*\]", re.IGNORECASE)
_MILLISECONDS = 1e11
"""Larger numbers are milliseconds: seconds since 1970 stay below this until the year 5138."""
_POLE, _DATE_LINE = 90.0, 180.0


@dataclass(frozen=True, slots=True)
class TimedFix:
    """One row: a fix, and its time in seconds since 1970, or None for a row without a time."""

    fix: GpsFix
    time: float | None


@dataclass
class GpsTrack:
    """Usable rows of a track, with the counts of unusable ones."""

    rows: list[TimedFix] = field(default_factory=list)
    malformed: int = 0
    """Rows without a valid position, or whose numbers and times cannot be parsed."""
    stale: int = 0
    """Rows whose timestamp is not later than the previous one."""


def parse_track(text: str, name: str) -> GpsTrack:
    """Parse the text of a GPX, CSV or JSON document.

    Args:
        text: The text.
        name: Name of the document, for errors.

    Raises:
        SourceError: For any other format.
    """
    start = text.lstrip("\ufeff \t\r\n")[:1]
    if start == "<":
        rows: Iterable[Mapping[str, object] | None] = _gpx(text, name)
    elif start in {"{", "["}:
        rows = _json(text, name)
    else:
        rows = _csv(text, name)
    track = GpsTrack()
    last = -math.inf
    for row in rows:
        found = None if row is None else _fix(row)
        if found is None:
            track.malformed += 1
        elif found.time is not None and found.time <= last:
            track.stale += 1
        else:
            last = last if found.time is None else found.time
            track.rows.append(found)
    return track


def _gpx(text: str, name: str) -> Iterator[Mapping[str, object] | None]:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise SourceError(f"{name}: a GPX file declares no entities; this one is not read")
    parser: Any = ET.XMLPullParser(["end"])
    broken = False
    try:
        parser.feed(text.lstrip("\ufeff \t\r\n"))
        parser.close()
    except ET.ParseError:
        # A logger that ran out of battery leaves a truncated file.
        broken = True
    points = 0
    events = parser.read_events()
    while True:
        try:
            _, element = next(events)
        except (StopIteration, ET.ParseError):
            break
        if _local(element.tag) in {"trkpt", "rtept", "wpt"}:
            points += 1
            values = {_local(child.tag): child.text for child in element}
            yield {**values, "lat": element.get("lat"), "lon": element.get("lon")}
    if broken:
        yield None
    if not points:
        raise SourceError(f"{name} is XML without a track point; give a GPX file")


def _local(tag: object) -> str:
    return str(tag).rpartition("}")[2]


def _json(text: str, name: str) -> Iterator[Mapping[str, object] | None]:
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise SourceError(f"{name} is not JSON: {error}") from None
    except RecursionError:
        raise SourceError(f"{name} is no GPS track: its JSON is nested too deeply") from None
    for row in content if isinstance(content, list) else [content]:
        yield {str(key): row[key] for key in row} if isinstance(row, dict) else None


def _csv(text: str, name: str) -> Iterator[Mapping[str, object] | None]:
    lines = [line for line in text.lstrip("\ufeff").splitlines() if line.strip()]
    header = next((line for line in lines if not line.startswith("#")), "")
    delimiter = max(",;\t", key=header.count)
    names = [_canonical(column) for column in header.split(delimiter)]
    if not {"latitude", "longitude"} <= set(names):
        raise SourceError(
            f"{name}: the first line names no latitude and longitude; give a GPX file, or a CSV "
            "file with columns such as time,lat,lon,elevation"
        )
    body = "\n".join(line for line in lines[lines.index(header) + 1 :] if line[0] != "#")
    reader = csv.reader(io.StringIO(body.replace("\0", "")), delimiter=delimiter)
    while True:
        try:
            cells = next(reader)
        except StopIteration:  # noqa: PERF203 - reading goes on after an error
            return
        except csv.Error:
            # A quote that is never closed would take in the rest; reading goes on after it.
            yield None
        else:
            # Cells without a name may be halves of numbers with decimal commas.
            fits = len(cells) >= len(names) - 1 and not any(cells[len(names) :])
            yield dict(zip(names, cells, strict=False)) if fits else None


def _canonical(column: str) -> str:
    bare = re.sub(r"[^a-z]", "", _UNITS.sub("", column.strip().strip('"')).lower())
    return next((name for name, spellings in _NAMES.items() if bare in spellings), bare)


def _fix(row: Mapping[str, object]) -> TimedFix | None:
    values = {_canonical(name): value for name, value in row.items()}
    latitude, longitude = _number(values.get("latitude")), _number(values.get("longitude"))
    if latitude is None or longitude is None:
        return None
    nowhere = latitude == 0.0 and longitude == 0.0
    if nowhere or abs(latitude) > _POLE or abs(longitude) > _DATE_LINE:
        return None
    told = values.get("time")
    if values.get("date") and told is not None:
        told = f"{values['date']} {told}"
    untimed = told is None or told == ""
    time = None if untimed else _time(told)
    if time is None and not untimed:
        return None
    fix = GpsFix(
        latitude,
        longitude,
        _number(values.get("altitude")) or 0.0,
        horizontal_sigma=abs(_number(values.get("accuracy")) or 0.0),
        satellites=int(_number(values.get("satellites")) or 0),
    )
    return TimedFix(fix, time)


def _number(value: object) -> float | None:
    try:
        number = float(str(value).strip())
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _time(value: object) -> float | None:
    number = _number(value)
    if number is not None:
        return number / 1000 if number > _MILLISECONDS else number
    text = str(value).strip().replace("/", "-").replace("Z", "+00:00")
    # Python 3.10 parses fractions of three or six digits only.
    text = re.sub(r"\.(\d+)", lambda found: f".{found[1]:0<6.6}", text)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    return moment.timestamp()


_log = logging.getLogger(__name__)
_LARGEST = 64 * 2**20
_LARGEST_ANSWER = 2**20
_LOST_AFTER = 3
"""Consecutive failures after which an alert is published."""


class GpsLoggerAnalytics(Analytics[GpsFix]):
    """An external source of the fixes of a GPS logger, such as one that a person carries.

    ``GpsLoggerAnalytics("vip.gpx").deploy(edge).instantiate()``. The source is a GPX or CSV file,
    or the `http://` address of a feed that answers with its newest row (JSON, CSV or GPX).

    The first timestamp of a file is mission time zero, plus `offset` seconds: a row written 10 s
    after the first one is current 10 s into the mission, at any speed. Rows
    without timestamps follow each other at `rate`. Each fix is published once. A feed is polled
    at `rate` by the wall clock, and its rows are stamped on arrival.
    """

    produces: ClassVar[type] = GpsFix
    resources: ClassVar[Mapping[str, ResourceUse]] = {"source": "input"}

    def __init__(
        self,
        source: str | Path,
        *,
        rate: Positive = 1.0,
        offset: float = 0.0,
        max_age: Positive = 10.0,
        timeout: Positive = 2.0,
    ) -> None:
        """Read a file, which is copied to where it runs; a feed is first polled in flight.

        Args:
            source: Path of a GPX, CSV or JSON file, or `http://` or `https://` address of a feed.
            rate: Polling rate of a feed and rate of rows without timestamps, Hz.
            offset: Mission time of the file's first row, seconds.
            max_age: Seconds after which a fix is counted as stale instead of published.
            timeout: Seconds that a feed has to answer.

        Raises:
            SourceError: If the file cannot be read, is larger than 64 MiB or has no usable row.
            ConfigError: If a setting is out of range.
        """
        for name, value in (("rate", rate), ("max_age", max_age), ("timeout", timeout)):
            if not 0.0 < value < math.inf:
                raise ConfigError(f"{type(self).__name__}: {name} must be above 0, not {value}")
        if not math.isfinite(offset):
            raise ConfigError(f"{type(self).__name__}: offset must be finite, not {offset}")
        self.source = str(source)
        self.rate = rate
        self.max_age = max_age
        self.timeout = timeout
        self.malformed = 0
        """Number of rows so far that could not be parsed."""
        self.stale = 0
        """Number of rows so far that arrived too late or had an old timestamp."""
        self.failures = 0
        """Number of requests so far that a feed did not answer."""
        self._is_feed = self.source.startswith(("http://", "https://"))
        self._times: list[float] = []
        self._fixes: list[GpsFix] = []
        self._last = -math.inf
        self._failed_in_a_row = 0
        self._client: httpx.Client | None = None
        if not self._is_feed:
            self._load(Path(source), offset)

    def open(self) -> None:
        """Make the client of a feed, which connects with its first request."""
        if self._is_feed:
            tls = ssl.create_default_context()
            self._client = http_client(self.timeout, tls=tls, public=True)

    def close(self) -> None:
        """Log the numbers of unused rows and failed requests."""
        if self._client is not None:
            self._client.close()
        if self.malformed or self.stale or self.failures:
            _log.warning(
                "%s: %d malformed rows, %d stale ones, %d requests without an answer",
                self.source,
                self.malformed,
                self.stale,
                self.failures,
            )

    def process(self, item: None, context: Context) -> GpsFix | None:
        """Return the newest fix if it has not been published yet, else None.

        Args:
            item: Ignored.
            context: Services of its node, with the present mission time.
        """
        del item
        if self._is_feed:
            return self._ask(context)
        now = seconds(context.now())
        index = bisect.bisect_right(self._times, now) - 1
        if index < 0 or self._times[index] <= self._last:
            return None
        self._last = self._times[index]
        if now - self._last > self.max_age:
            self.stale += 1
            return None
        return self._fixes[index]

    def _load(self, path: Path, offset: float) -> None:
        try:
            if path.stat().st_size > _LARGEST:
                raise SourceError(f"{path} is larger than {_LARGEST >> 20} MiB; cut it shorter")
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError as error:
            raise SourceError(f"cannot read the GPS log {path}: {error.strerror}") from None
        track = parse_track(text, str(path))
        self.malformed, self.stale = track.malformed, track.stale
        timed = [row for row in track.rows if row.time is not None]
        rows = timed or track.rows
        self.malformed += len(track.rows) - len(rows)
        if not rows:
            raise SourceError(
                f"{path} holds no usable row ({self.malformed} malformed); it needs latitude and "
                "longitude in degrees"
            )
        first = rows[0].time or 0.0
        steps = [
            index / self.rate if row.time is None else row.time - first
            for index, row in enumerate(rows)
        ]
        self._times = [step + offset for step in steps]
        self._fixes = [row.fix for row in rows]

    def _ask(self, context: Context) -> GpsFix | None:
        try:
            rows = self._fetch()
        except (SourceError, ValueError) as error:
            self.failures += 1
            self._failed_in_a_row += 1
            if self._failed_in_a_row == _LOST_AFTER:
                text = f"the GPS feed {self.source} does not answer: {error}"
                header = Header(self.failures, context.now(), self.name or "gps_logger")
                context.alert(Alert(header, "gps_feed_lost", text))
            return None
        self._failed_in_a_row = 0
        return self._newest(rows)

    def _newest(self, rows: list[TimedFix]) -> GpsFix | None:
        if not rows:
            return None
        newest = rows[-1]
        if newest.time is None:
            return newest.fix
        if newest.time <= self._last:
            return None
        self._last = newest.time
        if time.time() - newest.time > self.max_age:
            self.stale += 1
            return None
        return newest.fix

    def _fetch(self) -> list[TimedFix]:
        assert self._client is not None  # noqa: S101 - made by `open`
        until = time.monotonic() + self.timeout
        with http_errors(SourceError), self._client.stream("GET", self.source) as answer:
            content = read_at_most(answer, _LARGEST_ANSWER, until)
        if not answer.is_success:
            raise SourceError(f"status {answer.status_code}")
        track = parse_track(content.decode("utf-8", errors="replace"), self.source)
        self.malformed += track.malformed
        self.stale += track.stale
        return track.rows
