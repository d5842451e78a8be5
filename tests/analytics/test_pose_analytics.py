"""People's joints: cuts lie where they should, people are bounded, wrong models are refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.detection.keypoints import KeypointModel
from aerodaas.analytics.models import DETECTOR, POSE
from aerodaas.analytics.people.body_pose import BodyPoseEmergencyAnalytics
from aerodaas.analytics.people.joints import GREY, cut_region, square_around
from aerodaas.analytics.people.pose import PoseAnalytics, body_around
from aerodaas.dataflow.graph import AeroStreamData, Graph, Node
from aerodaas.errors import ConfigError, GraphError, ModelError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from tools.training.labelling import LabellingRenderer
from tools.training.looks import VariousLooks
from tools.training.pose_evaluate import PARTS
from tools.training.rendering import HELD_OUT
from tools.training.scenes import draw_camera, draw_view, draw_world

FRESH = HELD_OUT + 700
"""Seeds from here on were neither trained on nor measured with."""


class Boxes(OnnxDetector):
    """A detector that finds the boxes it is told."""

    def tell(self, *items: Detection) -> Boxes:
        """Find these from now on."""
        self.items = items
        return self

    def detect(self, frames: Sequence[Frame]) -> list[Detections]:
        """Find them."""
        return [Detections.of(frame, self.items) for frame in frames]


def picture(image: np.ndarray) -> Frame:
    """A frame of `image`."""
    return Frame(Header(0, 0, "drone/cam"), image)


def posing(*items: Detection, most: int = 5) -> PoseAnalytics:
    """The analysis on given boxes, opened."""
    pose = PoseAnalytics(detector=Boxes().tell(*items), most=most, threads=1)
    pose.open()
    return pose


CUT = 128
GREY_FRAME = picture(np.full((360, 640, 3), GREY, np.uint8))


@given(
    left=st.floats(-200, 500),
    top=st.floats(-200, 300),
    long=st.floats(30, 600),
    at=st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9)),
)
def test_a_cut_shows_what_lies_in_its_square(
    left: float, top: float, long: float, at: tuple[float, float]
) -> None:
    """A bright patch appears where the square has it, at any zoom, over the edge, too."""
    square = square_around((left, top, left + long / 3, top + long))
    u, v = (square[k] + at[k] * square[2] for k in (0, 1))
    image = np.zeros((360, 640, 3), np.uint8)
    half = max(2, round(square[2] / CUT * 2))
    inside = half <= u < 640 - half and half <= v < 360 - half
    if inside:
        image[round(v) - half : round(v) + half, round(u) - half : round(u) + half] = 255
    cut = cut_region(image, square, (CUT, CUT))
    assert cut.shape == (CUT, CUT, 3)
    if inside:
        there = np.argwhere(cut[..., 0] > 200).mean(axis=0)[::-1] + 0.5
        assert there == pytest.approx(np.array(at) * CUT, abs=2.0 + CUT / square[2])


def test_a_square_beside_the_picture_is_grey() -> None:
    """A box can be anywhere."""
    assert (cut_region(GREY_FRAME.image, (-900, 0, 100, 100), (CUT, CUT)) == GREY).all()


@pytest.mark.parametrize("vest", [(100.0, 100.0, 140.0, 160.0), (100.0, 100.0, 180.0, 140.0)])
def test_the_body_around_a_vest_holds_it(vest: tuple[float, float, float, float]) -> None:
    """Upright or lying, and is two to four vests long."""
    left, top, right, bottom = body_around(vest)
    assert left < vest[0] < vest[2] < right
    assert top < vest[1] < vest[3] < bottom
    long = max(vest[2] - vest[0], vest[3] - vest[1])
    assert 2 * long < max(right - left, bottom - top) < 4 * long


def test_only_the_largest_people_are_looked_at() -> None:
    """A crowd costs no more than five."""
    crowd = [Detection((20.0 * k, 50, 20.0 * k + 10 + k, 100), "person", 0.5) for k in range(20)]
    found = posing(*crowd).detect(GREY_FRAME)
    assert sorted(one.box for one in found) == sorted(one.box for one in crowd[-5:])
    assert all(one.keypoints is not None and one.keypoints.shape == (17, 3) for one in found)
    assert len(posing(*crowd, most=1).detect(GREY_FRAME)) == 1


def test_a_vest_stands_for_the_person_who_has_no_box() -> None:
    """And for nobody else where the person has one."""
    vest = Detection((300.0, 100.0, 340.0, 160.0), "vest", 0.8)
    assert [one.label for one in posing(vest).detect(GREY_FRAME)] == ["person"]
    person = Detection((290.0, 60.0, 350.0, 250.0), "person", 0.4)
    assert [one.box for one in posing(vest, person).detect(GREY_FRAME)] == [person.box]


def test_two_boxes_of_one_body_are_one() -> None:
    """With an arm and without; one far behind stays another."""
    trunk = Detection((280.0, 85.0, 370.0, 350.0), "person", 0.5)
    arm = Detection((255.0, 40.0, 380.0, 300.0), "person", 0.4)
    behind = Detection((290.0, 90.0, 310.0, 140.0), "person", 0.3)
    found = posing(trunk, arm, behind).detect(GREY_FRAME)
    assert [one.box for one in found] == [(255.0, 40.0, 380.0, 350.0), behind.box]


def test_nobody_is_no_error() -> None:
    """Of a grey picture, of no pixels at all, and by the detector that ships."""
    pose = PoseAnalytics(threads=1)
    pose.open()
    assert not pose.detect(GREY_FRAME).items
    assert not pose.detect(picture(np.zeros((0, 0, 3), np.uint8))).items


def test_wrong_models_and_numbers_are_refused() -> None:
    """The detector finds no keypoints, the keypoint model detects nothing."""
    with pytest.raises(ModelError, match="finds no keypoints in cuts"):
        KeypointModel(DETECTOR)
    with pytest.raises(ModelError, match="not to detect"):
        OnnxDetector(POSE)
    with pytest.raises(ConfigError, match="most must be 1"):
        PoseAnalytics(most=0)
    with pytest.raises(ModelError, match=r"open\(\)"):
        KeypointModel().find(GREY_FRAME.image, [(0.0, 0.0, 10.0, 10.0)])


def test_on_a_camera_it_is_a_task_of_its_own() -> None:
    """Called `body_pose`, so that environment files can speak of it."""
    graph = Graph()
    graph.add(Node("drone/cam", "sensor", Frame, None, robot="drone"))
    BodyPoseEmergencyAnalytics().analyse(AeroStreamData(graph, "drone/cam", Frame))
    work = graph.nodes["drone/body_pose"].work
    assert isinstance(work, PoseAnalytics)
    assert work.scheduled
    with pytest.raises(GraphError):
        PoseAnalytics().analyse(AeroStreamData(graph, "drone/body_pose", Detections))


@pytest.mark.slow
def test_joints_are_found_in_fresh_worlds() -> None:
    """Most within a fifth of the true box's longer side, wrists included."""
    network = KeypointModel(threads=1)
    network.open()
    errors = []
    for seed in range(FRESH, FRESH + 6):
        rng = np.random.default_rng([seed, 1])
        world, camera = draw_world(seed), draw_camera(rng)
        renderer = LabellingRenderer(world, camera, VariousLooks())
        for step in range(8):
            view = draw_view(world, camera, float(step), rng)
            image = renderer.render(view.time, view.pose)
            for label in renderer.labels(view.time, view.pose):
                long = float((label.box[2:] - label.box[:2]).max())
                if label.keypoints is None or long < 80:
                    continue
                left, top, right, bottom = label.box.tolist()
                (found,) = network.find(np.asarray(image), [(left, top, right, bottom)])
                away = np.hypot(*(found[:, :2] - label.keypoints[:, :2]).T) / long
                errors.append(np.where(label.keypoints[:, 2] == 2, away, np.nan))
        renderer.close()
    table = np.array(errors)
    assert len(table) > 10
    for name, least in (("nose, eyes, ears", 0.8), ("wrists", 0.5)):
        part = table[:, PARTS[name]]
        assert (part[np.isfinite(part)] <= 0.2).mean() > least
