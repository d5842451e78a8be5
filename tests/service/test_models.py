"""Models that users bring: each tenant's apart, bounded, and gone when nobody needs them."""

from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path
from typing import Any

import pytest
from offered import Provider
from served import document

from aerodaas.analytics.models import DETECTOR
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.errors import ConfigError
from aerodaas.protocol.schemas import MissionPhase
from aerodaas.service.errors import RefusedError
from aerodaas.service.models import model_store as models
from aerodaas.service.models.model_store import ModelStore

DAY = 86400.0


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModelStore:
    """One with room for 100 bytes of each tenant."""
    monkeypatch.setattr(models, "_LARGEST_SHELF", 100)
    return ModelStore(tmp_path / "models")


def bring(shelf: ModelStore, tenant: str, letter: str, size: int = 40) -> str:
    """Bring a model of `size` bytes; returns its name."""
    content = letter.encode() * size
    name = hashlib.sha256(content).hexdigest()
    shelf.put(tenant, name, content)
    return name


def age(folder: Path, name: str, seconds: float) -> None:
    """Let a model be unused for so long."""
    then = time.time() - seconds
    (path,) = folder.rglob(f"{name}.onnx")
    os.utime(path, (then, then))


def naming(name: str) -> MissionDocument:
    """A document with a model."""
    found: dict[str, Any] = {"id": "one/people", "analysis": "OnnxDetector", "reads": ["one/cam"]}
    found["settings"] = {"path": {"$model": "m", "sha256": name}}
    return MissionDocument.model_validate(
        document("one", (5, 0), sensors=["one/cam"], analyses=[found])
    )


def test_a_tenant_sees_its_own_models_and_those_that_ship(shelf: ModelStore) -> None:
    """What others work with is theirs."""
    name = bring(shelf, "farm", "a")
    assert shelf.has("farm", name)
    assert not shelf.has("city", name)
    assert shelf.has("city", hashlib.sha256(DETECTOR.read_bytes()).hexdigest())


def test_the_longest_unused_goes_for_a_new_one(shelf: ModelStore, tmp_path: Path) -> None:
    """Once it was unused for a day: of its own tenant, and no more of them than must."""
    first, second = bring(shelf, "farm", "a"), bring(shelf, "farm", "b")
    other = bring(shelf, "city", "c", 100)
    for name in (first, second, other):
        age(tmp_path, name, 2 * DAY)
    age(tmp_path, first, 3 * DAY)
    bring(shelf, "farm", "d")
    kept = [shelf.has("farm", first), shelf.has("farm", second), shelf.has("city", other)]
    assert kept == [False, True, True]


def test_what_was_used_within_a_day_stays(shelf: ModelStore, tmp_path: Path) -> None:
    """A mission that waits for its drones may name it; the new one is refused, with the reason."""
    first, second = bring(shelf, "farm", "a"), bring(shelf, "farm", "b")
    for name in (first, second):
        age(tmp_path, name, 0.9 * DAY)
    with pytest.raises(RefusedError, match="models of farm fill") as refused:
        bring(shelf, "farm", "d")
    assert refused.value.status == 507
    assert shelf.has("farm", first)
    assert shelf.has("farm", second)
    # What fits is taken all the same.
    bring(shelf, "farm", "d", 20)


def test_what_is_here_needs_no_room_to_be_sent_again(shelf: ModelStore) -> None:
    """As by two applications at once, of which neither had found it."""
    first = bring(shelf, "farm", "a", 60)
    assert bring(shelf, "farm", "a", 60) == first
    assert shelf.has("farm", first)


def test_to_ask_for_a_model_is_to_use_it(shelf: ModelStore, tmp_path: Path) -> None:
    """An application asks before it sends one."""
    first, second = bring(shelf, "farm", "a"), bring(shelf, "farm", "b")
    for name in (first, second):
        age(tmp_path, name, 2 * DAY)
    assert shelf.has("farm", first)
    bring(shelf, "farm", "d")
    assert (shelf.has("farm", first), shelf.has("farm", second)) == (True, False)


def test_a_model_that_is_lent_outlives_the_shelf(shelf: ModelStore, tmp_path: Path) -> None:
    """A flight has a link of its own, and another tenant none."""
    name = bring(shelf, "farm", "a")
    flight = tmp_path / "flight"
    flight.mkdir()
    shelf.link_models("farm", naming(name), flight)
    age(tmp_path / "models", name, 2 * DAY)
    bring(shelf, "farm", "b", 90)
    assert (flight / f"{name}.onnx").read_bytes() == b"a" * 40
    assert not shelf.has("farm", name)
    with pytest.raises(ConfigError, match="has not been sent"):
        shelf.link_models("city", naming(name), flight)


def test_a_mission_that_is_over_holds_no_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its link would keep the disk full after all."""
    provider = Provider(tmp_path, monkeypatch)
    content = b"network"
    name = hashlib.sha256(content).hexdigest()
    ModelStore(provider.settings.models).put("farm", name, content)
    mission = provider.flying(document=naming(name).model_dump(exclude_none=True))
    lent = provider.started[-1].models / f"{name}.onnx"
    assert lent.read_bytes() == content
    provider.land()
    provider.turns()
    assert provider.phase(mission) is MissionPhase.LANDED
    assert not lent.exists()
    provider.missions.close()
    provider.store.close()


@pytest.mark.parametrize("name", ["", "a" * 63, "../" + "a" * 61, "A" * 64])
def test_a_model_is_called_by_its_hash(shelf: ModelStore, name: str) -> None:
    """And by nothing that is a path."""
    with pytest.raises(ConfigError, match="SHA-256"):
        shelf.has("farm", name)
    with pytest.raises(ConfigError, match="SHA-256"):
        shelf.put("farm", name, b"x")
