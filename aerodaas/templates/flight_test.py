"""The application flies as it should: `pytest`, in this folder."""

from pathlib import Path

from aerodaas.testing.flight import fly

APPLICATION = Path(__file__).with_name("my_app.py")


def test_it_comes_down_where_it_should(tmp_path: Path) -> None:
    """The mission ends by itself, and nobody was alarmed."""
    flight = fly(APPLICATION, tmp_path, seed=7)
    assert flight.robots["drone"].outcome.startswith("landed")
    # A drone that gives way to somebody says so; whatever else it says is worth a look.
    assert not [one for one in flight.alerts if one[1] != "person_close"]
