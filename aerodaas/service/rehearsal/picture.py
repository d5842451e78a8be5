"""Picture of a rehearsed flight: its path, its fence, other leases' areas and what was refused."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.overlay import OKABE_ITO
from aerodaas.recording.report.page.figures import png_of
from aerodaas.recording.report.plots.style import mark
from aerodaas.recording.report.plots.trajectory import trajectory_figure
from aerodaas.service.flights.environment import Outline
from aerodaas.service.flights.orders import OtherLease
from aerodaas.service.rehearsal.clearance import clearances
from aerodaas.service.rehearsal.findings import Finding, findings_of

__all__ = ["draw"]

_LEASED, _NO_FLY, _REFUSED = OKABE_ITO["vermilion"], OKABE_ITO["grey"], OKABE_ITO["vermilion"]


def draw(
    recording: Path,
    picture: Path,
    config: EnvironmentConfig,
    *,
    minutes: float,
    others: Sequence[OtherLease] = (),
) -> None:
    """Write a PNG of a rehearsed flight.

    It needs the extra `plots`. Numbered crosses mark the places of the reasons, in the verdict's
    order; reasons without a place have none.

    Args:
        recording: MCAP file of the flight.
        picture: File to write.
        config: Environment that it flew in.
        minutes: Of the lease.
        others: Areas of all other granted leases.

    Raises:
        RecordingError: If the recording cannot be read, or the picture cannot be written.
        ConfigError: If a robot's fence, the world or the terrain is invalid.
    """
    with Recording.open(recording) as opened:
        flight = RecordedFlight.read(opened)
    nearest = clearances(flight, config)
    findings = findings_of(flight, config, minutes=minutes, others=others, nearest=nearest)
    no_fly = [zone for robot in config.robots for zone in robot.limits.geofence.no_fly]
    overlay = partial(_overlay, findings=findings, others=others, no_fly=no_fly)
    png = png_of(flight, partial(trajectory_figure, overlay=overlay))
    try:
        picture.write_bytes(png)
    except OSError as error:
        raise RecordingError(f"cannot write {picture}: {error.strerror}") from None


def _overlay(
    axes: Axes,
    *,
    findings: Sequence[Finding],
    others: Sequence[OtherLease],
    no_fly: Sequence[Outline],
) -> list[Artist]:
    entries: list[Artist] = []
    for zone in no_fly:
        shape = Polygon(zone, facecolor=_NO_FLY, alpha=0.4, label="no-fly zone")
        axes.add_patch(shape)
        entries[:] = [*(one for one in entries if one.get_label() != shape.get_label()), shape]
    for other in others:
        shape = Polygon(other.area, facecolor="none", edgecolor=_LEASED, hatch="//", alpha=0.6)
        shape.set_label(f"lease {other.id}")
        axes.add_patch(shape)
        entries.append(shape)
    placed = [(number, one.place) for number, one in enumerate(findings, start=1) if one.place]
    for number, place in placed:
        axes.plot(*place, "X", color=_REFUSED, markeredgecolor="black", markersize=12, zorder=7)
        axes.annotate(
            str(number),
            place,
            xytext=(9, -4),
            textcoords="offset points",
            zorder=8,
            color=_REFUSED,
            fontweight="bold",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1},
        )
    if placed:
        entries.append(mark("reason of the refusal, by number", _REFUSED, "X"))
    count = f"{len(findings)} reason{'s' if len(findings) > 1 else ''}"
    axes.set_title(f"Refused for {count}" if findings else "No objection")
    return entries
