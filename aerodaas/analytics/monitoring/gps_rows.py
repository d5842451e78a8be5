"""Parser of GPS logger tracks: GPX, CSV and JSON text to timed fixes.

Malformed rows are counted. Formats vary between loggers: columns are recognised by the common
spellings of their names, and times may be ISO 8601 (UTC without a zone) or seconds or
milliseconds since 1970.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Any
from xml.etree import ElementTree as ET

from aerodaas.errors import SourceError
from aerodaas.messages.odometry import GpsFix

__all__ = ["GpsTrack", "TimedFix", "parse_track"]

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
    """Parse the text of a GPX, CSV or JSON document called `name`.

    Raises SourceError for any other format.
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
