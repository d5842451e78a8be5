"""The paper's listings run as printed, their ellipses filled in and their imports added."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
from flying import Flyer

from aerodaas import Robot
from aerodaas.environment.run import Run
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

LISTINGS = Path(__file__).parent / "listings"


def lines(text: str) -> list[str]:
    """Lines of a listing without LaTeX's marks."""
    bare = re.sub(r"\(\*@.*?@\*\)", "", text)
    return [line.strip() for line in bare.splitlines() if line.strip()]


@pytest.mark.parametrize("listing", ["situation_awareness", "farm_survey", "disaster_survey"])
def test_listings_are_the_papers_own(listing: str) -> None:
    """Every line that the paper prints as code stands in the file, in the paper's order."""
    printed = (LISTINGS / "printed" / f"{listing}.tex").read_text(encoding="utf-8")
    wanted = [line for line in lines(printed) if not line.startswith("Static Waypoint list")]
    ours = lines((LISTINGS / f"{listing}.py").read_text(encoding="utf-8"))
    places = [ours.index(line) for line in wanted]
    assert len(wanted) > 10
    assert places == sorted(places)


def test_the_farm_survey_flies_as_printed(flyer: Flyer) -> None:
    """Four waypoints, visited nearest first, with hovers; then home, monitored all the way."""
    application = LISTINGS / "farm_survey.py"
    with flyer.options(application=application):
        runpy.run_path(str(application), run_name="__main__")
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        assert recording.complete
        readings = [record for record in recording.records() if "monitoring" in record.topic]
        flight = RecordedFlight.read(recording)
    drone = flight.robots["quadrotor_base"]
    assert drone.outcome.startswith("landed")
    assert drone.visited == ("wp1", "wp4", "wp3", "wp2")
    assert [band.end - band.start for band in drone.bands if band.state == "loitering"] == [
        pytest.approx(5.0, abs=0.3)
    ] * 4
    assert len(readings) > 100
    assert abs(drone.position[-1][:2]).max() < 1.0


def test_the_disaster_survey_builds_as_printed(
    flyer: Flyer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up to its start, which waits for a remote user, the listing gives the graph that it shows."""
    started: list[Robot] = []
    monkeypatch.setattr(Robot, "start_mission", lambda drone: started.append(drone))  # noqa: PLW0108
    application = LISTINGS / "disaster_survey.py"
    with flyer.options(application=application):
        names = runpy.run_path(str(application), run_name="__main__")
        env = names["env"]
        assert started == [names["drone"]]
        env.place_entries()
        plan = Run(env).plan()
    nodes = {node.stream: tuple(node.inputs) for node in plan.analyses}
    assert nodes == {
        "quadrotor_base/monitoring": ("quadrotor_base/odom",),
        "quadrotor_base/remote": ("quadrotor_base/cam1",),
    }
    (spec,) = plan.drones[0]
    assert spec.navigation == ("quadrotor_base/remote",)
    assert len(spec.initial) == 2
