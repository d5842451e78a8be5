"""A flight's folder: begun once, its lock tells whether it flies, files whole or not at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from flight_orders import order_in

from aerodaas.errors import ConfigError, MissionError
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import FlightOrder, Outcome

HOLD = """
import sys, time
from pathlib import Path
from aerodaas.service.flights.folder import FlightFolder
with FlightFolder(Path(sys.argv[1])).claim():
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def folder(tmp_path: Path) -> FlightFolder:
    """A folder with an order."""
    made = FlightFolder(tmp_path / "f")
    made.make(order_in(tmp_path), "{}")
    return made


def test_a_flight_begins_once(folder: FlightFolder) -> None:
    """Whatever has become of the first time."""
    assert (folder.begun, folder.flying) == (False, False)
    with folder.claim():
        assert (folder.begun, folder.flying) == (True, True)
        with pytest.raises(MissionError, match="begun before"), folder.claim():
            pass
        assert folder.flying
    assert (folder.begun, folder.flying) == (True, False)
    with pytest.raises(MissionError, match="begun before"), folder.claim():
        pass
    assert not folder.flying


def test_a_killed_process_flies_no_more(folder: FlightFolder) -> None:
    """Its lock goes with it, and its flight stays begun."""
    command = [sys.executable, "-c", HOLD, str(folder.path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert folder.flying
        process.kill()
        process.wait()
    assert (folder.begun, folder.flying) == (True, False)
    assert folder.outcome() is None


def test_files_are_their_users_alone(folder: FlightFolder) -> None:
    """Order and document may tell where a tenant flies."""
    for path in (folder.order, folder.document):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_an_outcome_is_there_whole_or_not_at_all(folder: FlightFolder) -> None:
    """Half a file is none."""
    outcome = Outcome(landed=True, began=1.0, ended=2.0)
    folder.end(outcome)
    assert folder.outcome() == outcome
    path = folder.path / "outcome.json"
    path.write_bytes(path.read_bytes()[:20])
    assert folder.outcome() is None


def test_a_malformed_order_is_refused_by_name(folder: FlightFolder) -> None:
    """It names the file and the field."""
    folder.order.write_text('{"mission": "m"}')
    with pytest.raises(ConfigError, match=r"order\.json.*lease"):
        FlightOrder.read(folder.order)


def test_a_socket_has_a_path_that_the_system_allows() -> None:
    """In the folders that a service makes."""
    assert len(os.fsencode(FlightFolder(Path("/tmp/s/m/0123456789ab/f")).socket)) < 100  # noqa: S108
