"""A mission document flies as the application does that it was compiled from."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from flying import Flyer

from aerodaas.config.options import current_options
from aerodaas.environment.document.flying import (
    compile_application,
    fly_mission,
    recorded_document,
)
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

APPS = Path(__file__).resolve().parents[2] / "apps"


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "name", ["farm_survey", pytest.param("vehicle_tracking", marks=pytest.mark.slow)]
)
def test_a_document_flies_as_its_application(flyer: Flyer, name: str) -> None:
    """In simulated time, with one seed: the same trajectory, to the last digit."""
    application = APPS / f"{name}.py"
    document = compile_application(application, [])
    path = flyer.folder / f"{name}.json"
    path.write_text(document.text())
    # Three pictures a second show the same as fifteen do, and cost a fifth of the detector's time.
    content = json.loads((APPS / "environments" / document.environment).read_text())
    for sensor in content["robots"][0]["sensors"]:
        sensor["rate"] = 3
    place = flyer.write(content, Path(document.environment).name)
    flights = []
    for number in range(2):
        record = flyer.folder / f"flight{number}"
        with flyer.options(
            simulated_time=True, seed=3, record=record, environment=place, application=application
        ):
            if number == 0:
                runpy.run_path(str(application), run_name="__main__")
            else:
                fly_mission(path, current_options.get())
        with Recording.open(record / "flight.mcap") as recording:
            flights.append(RecordedFlight.read(recording))
        # Each recording holds the document, whichever way it was flown.
        assert recorded_document(record / "flight.mcap").text() == document.text()
    (own,), (others,) = (flight.robots.values() for flight in flights)
    assert own.outcome == others.outcome
    assert own.visited == others.visited
    assert name != "vehicle_tracking" or "diverted" in {band.state for band in own.bands}
    assert len(own.position) > 100
    np.testing.assert_array_equal(own.position, others.position)
