"""Clothes that are no vest: what a detector of vests must not learn to take for one."""

from __future__ import annotations

import numpy as np
import pytest
from panda3d.core import NodePath

from aerodaas.simulation.scenario import Person
from aerodaas.simulation.scene.layers import LABEL
from aerodaas.simulation.scene.people import PersonFigure
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import Thing
from tools.training.garments import draw_garment
from tools.training.looks import VariousLooks


def garment(seed: int, colour: tuple[float, float, float] = (1.0, 0.2, 0.1)) -> np.ndarray:
    """Colours of a garment's texture, BGR."""
    texture = draw_garment(colour, np.random.default_rng(seed)).texture
    return np.frombuffer(texture.get_ram_image(), np.uint8).reshape(64, 64, 3)


def test_most_garments_are_printed_and_keep_their_colour() -> None:
    """Else plain shirts, or nothing of a shirt's colour, would be all that is learnt."""
    spread = [garment(seed).reshape(-1, 3).std(axis=0).max() for seed in range(30)]
    assert np.mean(np.array(spread) > 30) > 0.5
    red = [(garment(seed)[..., 2] > 2.0 * garment(seed)[..., 0]).mean() for seed in range(30)]
    assert np.median(red) > 0.4


@pytest.mark.parametrize("vest", ["none", "any"])
def test_who_wears_no_vest_has_no_vests_label(vest: str) -> None:
    """However garish the garment."""
    for seed in range(8):
        spec = Person.model_validate({"kind": "person", "id": "one", "at": (0, 0), "vest": vest})
        thing = Thing(spec, f"garments/{seed}", height=1.75)
        parent = NodePath("scene")
        PersonFigure(parent, thing, Palette(), VariousLooks().outfit(thing))
        labels = {node.get_tag(LABEL) for node in parent.find_all_matches(f"**/={LABEL}")}
        assert labels == ({"one/person"} if vest == "none" else {"one/person", "one/vest"})
