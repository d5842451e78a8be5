"""The six missions: application, criteria, and what the paper says of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from missions.criteria import (
    Check,
    Criterion,
    alerted_of,
    climbed,
    distance_held,
    fence_kept,
    followed,
    found_between,
    hit_nothing,
    landed,
    landed_upon,
    reached,
    states,
)
from missions.evidence import Evidence

__all__ = ["ADDED", "APPS", "MISSIONS", "Mission", "Paper"]

APPS = Path(__file__).resolve().parents[2] / "apps"

ADDED = ((10.0, 30.0, 1.5), (10.0, 12.0, 1.5), (0.0, 30.0, 1.5))
"""What the remote user adds to the Disaster Survey, in this order: 10 m x 20 m further north."""


@dataclass(frozen=True, slots=True)
class Paper:
    """Figures of the paper's section 6; None where it gives none."""

    duration: float
    """Seconds."""
    distance: float | None
    """Metres."""
    height: str
    """Metres."""
    latency: float | None
    """Milliseconds from frame to command, median."""
    overhead: float | None
    """Its part that is neither inference nor post-processing."""
    memory: float = 1.0
    """Gigabytes that the platform adds, at most."""
    lines: int = 40


@dataclass(frozen=True, slots=True)
class Mission:
    """One application and how its flight is judged."""

    name: str
    paper: Paper
    criteria: tuple[Criterion, ...]
    height: float | None
    """Metres at which it is to fly while it works; None where that changes."""
    working: tuple[str, ...] = ("enroute", "loitering", "following", "diverted")
    """States in which `height` counts."""
    remote_user: bool = False

    @property
    def application(self) -> Path:
        """Its file."""
        return APPS / f"{self.name}.py"

    def judge(self, recording: Path) -> list[Check]:
        """Hold a recording against every criterion."""
        evidence = Evidence.read(recording)
        return [criterion(evidence) for criterion in self.criteria]


SAFE = (hit_nothing, fence_kept)
START, HOME = "taking_off holding?", "returning landing landed"
SURVEY = ("wp1", "wp2", "wp3", "wp4")
REMOTE = ("remote1", "remote2", "remote3")

MISSIONS = {
    mission.name: mission
    for mission in (
        Mission(
            "farm_survey",
            Paper(120, 40, "1.5", None, None),
            (
                states(f"{START} (enroute? loitering){{4}} returning landing landed"),
                reached(*SURVEY),
                landed(at_home=1.0),
                *SAFE,
            ),
            height=1.5,
        ),
        Mission(
            "disaster_survey",
            Paper(142, None, "1.5", None, None),
            (
                states(f"{START} (holding? enroute? loitering holding?){{7}} {HOME}"),
                reached(*SURVEY, *REMOTE),
                landed(at_home=1.0),
                *SAFE,
            ),
            height=1.5,
            remote_user=True,
        ),
        Mission(
            "situation_awareness",
            Paper(250, 50, "1.3-1.6", 158, 10),
            (
                states(f"{START} (following holding?)+ landing landed"),
                followed("vip", 40, reach=4.0),
                distance_held("vip", 2.0, within=0.5, share=0.9, nearest=1.0),
                alerted_of("vip", "fallen", "fall", within=6.0),
                landed_upon("vip", "hand_raised", within=6.0),
                landed(),
                *SAFE,
            ),
            height=1.5,
        ),
        Mission(
            "vehicle_tracking",
            Paper(300, 50, "2.5-5", 35, 13),
            (
                states(
                    f"{START} (enroute? loitering) enroute? (diverted enroute?)+ "
                    "(enroute? loitering){2} returning landing landed"
                ),
                reached("wp1", "wp2", "wp3"),
                found_between("wp1", "wp2", "diverted"),
                followed("target", 25, reach=10.0),
                distance_held("target", 6.0, within=2.0, share=0.8, nearest=3.0, settled=15.0),
                landed(at_home=1.0),
                *SAFE,
            ),
            height=None,
        ),
        Mission(
            "search_and_rescue",
            Paper(360, 50, "1.5", 73, 17),
            (
                states(
                    f"{START} (enroute? loitering){{1,2}} enroute? (following holding?)+ "
                    "landing landed"
                ),
                reached("wp1", never=("wp3", "wp4")),
                followed("lost", 35, reach=4.0),
                distance_held("lost", 2.0, within=0.5, share=0.9, nearest=1.0),
                landed(),
                *SAFE,
            ),
            height=1.5,
        ),
        Mission(
            "tower_inspection",
            Paper(360, 130, "2-35", 35, 13),
            (
                states(
                    f"{START} (enroute? loitering){{2}} enroute (following holding?)+ "
                    "landing landed"
                ),
                reached("wp1", "wp2", never=("wp3", "wp4")),
                found_between("wp2", "wp3"),
                climbed("mast", 3.0, 34.5, clearance=4.0),
                landed(speed=0.8),
                *SAFE,
            ),
            height=None,
        ),
    )
}
