"""The keypoint network's training: its cuts, its heat maps, and what it exports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.analytics.body_cut import CUT, MARGIN
from aerodaas.analytics.onnx.keypoints import KeypointModel
from aerodaas.training.dataset import Pictures, Sample, save_shard
from aerodaas.training.pose_cuts import People
from aerodaas.training.pose_evaluate import PARTS, placing
from aerodaas.training.pose_export import export_pose
from aerodaas.training.pose_network import STRIDE, Joints, places
from aerodaas.training.pose_train import PoseRecipe, train_pose

BOX = np.array([[100, 60, 150, 180]], np.float32)


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> People:
    """Three pictures of one person each, whose joints are white dots."""
    folder = tmp_path_factory.mktemp("people")
    rng = np.random.default_rng(0)
    samples = []
    for _ in range(3):
        image = np.zeros((240, 320, 3), np.uint8)
        joints = np.full((1, 17, 3), 2.0, np.float32)
        joints[0, :, :2] = rng.uniform(BOX[0, :2] + 4, BOX[0, 2:] - 4, (17, 2)).round()
        for u, v in joints[0, :, :2].astype(int):
            image[v - 1 : v + 2, u - 1 : u + 2] = 255
        samples.append(Sample(image, np.array([1]), BOX, joints))
    save_shard(folder / "00000000.npz", samples)
    return People(Pictures(folder))


def test_a_plain_cut_holds_the_person_and_its_joints(people: People) -> None:
    """Each joint lies where its dot is."""
    cut = people.cut(0)
    assert cut.image.shape == (CUT, CUT, 3)
    assert cut.size == pytest.approx(CUT / MARGIN)
    for u, v, seen in cut.keypoints:
        assert seen == 2
        assert cut.image[int(v), int(u)].mean() > 100


@given(st.integers(0, 10_000))
def test_a_changed_cut_keeps_its_joints_within(people: People, seed: int) -> None:
    """However it was turned, mirrored, moved and covered: inside, or none."""
    cut = people.cut(seed % 3, np.random.default_rng(seed))
    there = cut.keypoints[:, 2] > 0
    assert ((cut.keypoints[there, :2] >= 0) & (cut.keypoints[there, :2] < CUT)).all()
    assert not cut.keypoints[~there].any()


@given(st.floats(3.0, 28.0), st.floats(3.0, 28.0))
def test_the_middle_of_a_hill_is_found(u: float, v: float) -> None:
    """To a tenth of a cell, whatever else is a little likely."""
    cells = torch.arange(32) + 0.5
    hill = -0.5 * ((cells[None] - u).square() + (cells[:, None] - v).square())
    (found,) = places(torch.maximum(hill, torch.tensor(-20.0))[None, None])[0]
    assert (found / STRIDE).tolist() == pytest.approx([u, v], abs=0.1)


@pytest.mark.slow
def test_it_trains_goes_on_and_exports(people: People, tmp_path: Path) -> None:
    """Two steps, not repeated; the file takes any number of cuts."""
    recipe = PoseRecipe(steps=2, batch=2)
    (progress,) = train_pose(people, recipe, tmp_path)
    assert np.isfinite(progress.parts).all()
    assert list(train_pose(people, recipe, tmp_path)) == []
    export_pose(tmp_path / "weights.pt", tmp_path / "pose.onnx")
    found = placing(tmp_path / "pose.onnx", people)
    assert found.errors.shape == (3, 17)
    assert 0.0 <= found.correct(PARTS["wrists"], 0.2) <= 1.0
    model = KeypointModel(tmp_path / "pose.onnx", threads=1)
    model.open()
    boxes = [(10.0, 10.0, 60.0, 100.0), (0.0, 0.0, 30.0, 30.0)]
    both = model.find(np.zeros((120, 160, 3), np.uint8), boxes)
    alone = model.find(np.zeros((120, 160, 3), np.uint8), boxes[1:])
    assert both[1] == pytest.approx(alone[0], abs=1e-3)


def test_the_exported_network_is_the_trained_one(tmp_path: Path) -> None:
    """Folding its norms changes nothing."""
    torch.manual_seed(3)
    network = Joints().eval()
    torch.save(network.state_dict(), tmp_path / "weights.pt")
    export_pose(tmp_path / "weights.pt", tmp_path / "pose.onnx")
    model = KeypointModel(tmp_path / "pose.onnx", threads=1)
    model.open()
    image = np.random.default_rng(0).integers(0, 255, (CUT, CUT, 3), dtype=np.uint8)
    side = CUT / MARGIN
    edge = (CUT - side) / 2
    (found,) = model.find(image, [(edge, edge, edge + side, edge + side)])
    pixels = torch.from_numpy(image[..., ::-1].copy()).permute(2, 0, 1)[None].float() / 255
    with torch.no_grad():
        maps, seen = network(pixels)
    assert found[:, 2] == pytest.approx(seen.sigmoid()[0].numpy(), abs=1e-3)
    assert np.median(np.abs(found[:, :2] - places(maps)[0].numpy())) < 0.5
