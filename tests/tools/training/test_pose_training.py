"""The keypoint network's training: its cuts, its heat maps, and what it exports."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.analytics.detection.keypoints import KeypointModel
from aerodaas.analytics.people.joints import BONES, MARGIN
from tools.training.dataset import Pictures, Sample, save_shard
from tools.training.pose_cuts import CUT, People
from tools.training.pose_evaluate import PARTS, placing
from tools.training.pose_export import export_pose
from tools.training.pose_network import STRIDE, Joints, places
from tools.training.pose_train import PoseRecipe, train_pose
from tools.training.surroundings import surrounded

UPRIGHT = [
    *[(64, 30, 2)] * 5,
    *((54, 45, 2), (74, 45, 2), (52, 60, 2), (76, 60, 2), (52, 74, 2), (76, 74, 2)),
    *((57, 72, 2), (71, 72, 2), (57, 90, 2), (71, 90, 2), (57, 106, 2), (71, 106, 2)),
]
"""Joints of one who stands in the middle of a cut."""
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
def test_other_surroundings_leave_the_person_alone(seed: int) -> None:
    """Not a pixel near a joint or a bone changes; beside them, most often some do."""
    rng = np.random.default_rng(seed)
    points = np.array(UPRIGHT, np.float32)
    image, other = np.zeros((CUT, CUT, 3), np.uint8), np.full((200, 300, 3), 255, np.uint8)
    changed = surrounded(image, points, 85.0, other, rng)[..., 0] > 0
    body = np.zeros((CUT, CUT), np.uint8)
    for bone in BONES:
        begin, end = points[list(bone), :2].astype(int).tolist()
        cv2.line(body, begin, end, 1)
    assert not (changed & (body > 0)).any()
    assert not changed[24:37, 58:71].any()


def test_other_surroundings_come_near() -> None:
    """To where arms would be."""
    points = np.array(UPRIGHT, np.float32)
    image, other = np.zeros((CUT, CUT, 3), np.uint8), np.full((200, 300, 3), 255, np.uint8)
    laid = [
        surrounded(image, points, 85.0, other, np.random.default_rng(seed))[20:40, 78:96].any()
        for seed in range(50)
    ]
    assert np.mean(laid) > 0.3


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
    session = onnxruntime.InferenceSession(tmp_path / "pose.onnx")
    pixels = torch.rand(2, 3, CUT, CUT, generator=torch.Generator().manual_seed(0))
    found = np.asarray(session.run(None, {session.get_inputs()[0].name: pixels.numpy()})[0])
    with torch.no_grad():
        maps, seen = network(pixels)
    assert found[..., 2] == pytest.approx(seen.sigmoid().numpy(), abs=1e-3)
    assert np.median(np.abs(found[..., :2] - places(maps).numpy())) < 0.5
