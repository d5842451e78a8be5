"""Analytics schedulers by name, file, class and instance."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import pytest
from ray import cloudpickle

from aerodaas.actors.run.application import capture
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.graph import Graph
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Profile, Resources
from aerodaas.schedulers.analytics.published.dems import Dems
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PASSIVE, PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names


@pytest.mark.parametrize("name", scheduler_names())
def test_every_registered_name_loads(name: str) -> None:
    """Each call makes an instance of its own, which can be sent to an actor."""
    first, second = load_scheduler(name), load_scheduler(name.upper().replace("_", "-"))
    assert first is not second
    assert type(first) is type(second)
    assert isinstance(pickle.loads(pickle.dumps(first)), AnalyticsScheduler)  # noqa: S301 - own bytes


def test_published_behaviour_has_a_name() -> None:
    """`dems_published` is DEMS as its code behaves; schedulers without departures have none."""
    found = load_scheduler("dems_published")
    assert isinstance(found, Dems)
    assert found.published
    assert not getattr(load_scheduler("dems"), "published", True)
    with pytest.raises(SchedulerError, match="published"):
        load_scheduler("cld_published")


def test_a_file_a_module_a_class_and_an_instance_load(tmp_path: Path) -> None:
    """A researcher's class needs no package."""
    file = tmp_path / "mine.py"
    file.write_text(
        "from aerodaas.schedulers.analytics import AnalyticsScheduler, Drop\n"
        "class Mine(AnalyticsScheduler):\n"
        "    def task_arrived(self, task, now):\n"
        "        return [Drop(task)]\n"
    )
    assert type(load_scheduler(f"{file}:Mine")).__name__ == "Mine"
    assert isinstance(load_scheduler("aerodaas.schedulers.analytics.published.dems:Dems"), Dems)
    assert isinstance(load_scheduler(Dems), Dems)
    one = Dems()
    assert load_scheduler(one) is one


def test_a_file_travels_with_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Found beside the application, wherever that is started; it reaches the actors by value."""
    (tmp_path / "travelling.py").write_text(
        "from aerodaas.schedulers.analytics import AnalyticsScheduler\n"
        "class Mine(AnalyticsScheduler): ...\n"
    )
    monkeypatch.chdir("/")
    config = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
    token = current_options.set(RunOptions(application=tmp_path / "app.py"))
    try:
        found = load_scheduler("travelling.py:Mine")
    finally:
        current_options.reset(token)
    name = type(found).__module__
    assert "Mine" in capture(Graph(), config, found).modules[name]
    del sys.modules[name]  # as in an actor: nobody finds the class there
    data = cloudpickle.dumps(found)  # pyright: ignore[reportPrivateImportUsage]
    again = pickle.loads(data)  # noqa: S301 - our own
    assert type(again).__name__ == "Mine"


@pytest.mark.parametrize(
    ("wanted", "error", "words"),
    [
        ("nope", UnknownIdError, "known: .*dems"),
        ("nope.py:Mine", SchedulerError, "cannot import"),
        ("no.such.module:Mine", SchedulerError, "cannot import"),
        (
            "aerodaas.schedulers.analytics.published.dems:Nope",
            SchedulerError,
            "cannot import .*Nope",
        ),
        ("aerodaas.schedulers.analytics.base:Task", SchedulerError, "no analytics scheduler"),
    ],
)
def test_what_cannot_be_loaded_is_named(wanted: str, error: type[Exception], words: str) -> None:
    """The message says what was wrong and what there is."""
    with pytest.raises(error, match=words):
        load_scheduler(wanted)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"deadline": 0}, "deadline must be positive"),
        ({"deadline": -5}, "deadline must be positive"),
        ({"edge_time": 0}, "edge_time"),
        ({"cloud_cost": -1.0}, "cloud_cost"),
        ({"edge_cost": float("nan")}, "edge_cost"),
        ({"edge_cost": 20.0, "cloud_cost": 10.0}, "never run"),
        ({"benefit": float("nan")}, "never run"),
    ],
)
def test_profiles_that_make_no_sense_are_refused(settings: dict[str, float], words: str) -> None:
    """Negative or missing deadlines, costs above benefits everywhere: named."""
    good = {"benefit": 10.0, "deadline": 5, "edge_time": 1, "cloud_time": 1}
    with pytest.raises(SchedulerError, match=f"'fire'.*{words}"):
        Profile("fire", **{**good, **settings})  # type: ignore[arg-type]


def test_resources_that_make_no_sense_are_refused() -> None:
    """A cloud of -1 slots."""
    with pytest.raises(SchedulerError, match="cloud_slots"):
        Resources(cloud_slots=-1)


def test_the_published_table() -> None:
    """Gains as in the published table; P is four models, A is all six."""
    gains = {name: (p.edge_gain, p.cloud_gain) for name, p in PUBLISHED.items()}
    assert gains == {
        "HV": (124, 100),
        "DEV": (99, 74),
        "MD": (74, 60),
        "BP": (38, -3),
        "CD": (171, 23),
        "DEO": (244, 40),
    }
    assert (len(PASSIVE), len(ACTIVE)) == (4, 6)
