"""The figures are COCO's, and those beside it are what they say."""

from __future__ import annotations

import contextlib
import io
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_models import patchwork_model

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import Box
from aerodaas.messages.detections import Detection
from tools.evaluation.dataset import AnnotatedPicture, Dataset, Thing
from tools.evaluation.figures import Evaluation, evaluate, measure

coco = pytest.importorskip("pycocotools.coco")
cocoeval = pytest.importorskip("pycocotools.cocoeval")


def dataset(*pictures: list[Thing]) -> Dataset:
    """Pictures of persons and cars."""
    return Dataset(
        tuple(AnnotatedPicture(Path(f"{n}.png"), tuple(one)) for n, one in enumerate(pictures)),
        ("person", "car"),
    )


def evaluated(pictures: Dataset, *found: list[Detection]) -> Evaluation:
    """Measured at a score of 0.3, for a model that knows cars and persons."""
    return measure(pictures, found, ["car", "person", "tree"])


BOX: Box = (10, 10, 60, 110)


def test_found_missed_and_false() -> None:
    """Two of three persons found, one tree trunk taken for a person, in a picture without one."""
    truth = dataset([Thing("person", BOX), Thing("person", (200, 10, 250, 110))], [], [])
    truth = Dataset(
        (*truth.pictures, AnnotatedPicture(Path("3.png"), (Thing("person", BOX),))), truth.labels
    )
    result = evaluated(
        truth,
        [Detection(BOX, "person", 0.9), Detection((200, 12, 250, 112), "person", 0.2)],
        [Detection((5, 5, 40, 90), "person", 0.8)],
        [],
        [Detection(BOX, "person", 0.7)],
    )
    person, car = result.classes
    assert person.things == 3
    assert person.recall == pytest.approx(2 / 3), "0.2 is below the score that flies"
    assert person.precision == pytest.approx(2 / 3)
    assert (person.false_boxes, person.false_per_picture) == (1, 0.25)
    assert person.false_alarms == 0.5, "one of the two pictures without a person"
    assert (car.things, car.false_alarms) == (0, 0)
    assert math.isnan(car.ap50)
    assert result.overall.ap50 == person.ap50, "a class without things has no part in the mean"
    assert [(one.label, one.score) for one in result.mistakes] == [
        ("person", 0.8),
        ("person", None),
    ]


def test_a_box_is_right_for_one_thing_only_and_of_its_class_only() -> None:
    """A second box on it is false; so is a car where a person stands."""
    result = evaluated(
        dataset([Thing("person", BOX)]),
        [Detection(BOX, "person", 0.9), Detection(BOX, "person", 0.8), Detection(BOX, "car", 0.7)],
    )
    assert [one.false_boxes for one in result.classes] == [1, 1]


def test_what_is_ignored_need_not_be_found_and_may_be() -> None:
    """As a crowd in COCO."""
    crowd = Thing("person", BOX, ignored=True)
    assert evaluated(dataset([crowd]), []).overall.things == 0
    seen = evaluated(dataset([crowd]), [Detection(BOX, "person", 0.9)])
    assert (seen.overall.false_boxes, list(seen.mistakes)) == (0, [])


def test_calibration() -> None:
    """Ten boxes of 0.95 of which half are right: the error is 0.45."""
    truth = dataset(*[[Thing("car", BOX)] if n % 2 else [] for n in range(10)])
    result = evaluated(truth, *[[Detection(BOX, "car", 0.95)] for _ in range(10)])
    assert result.overall.calibration_error == pytest.approx(0.45)
    last = result.reliability[-1]
    assert (last.boxes, last.right) == (10, 0.5)
    assert last.score == pytest.approx(0.95)


def test_no_label_in_common_is_an_error_with_the_remedy() -> None:
    """Another spelling is told of, and can be renamed."""
    people = Dataset((AnnotatedPicture(Path("a.png"), (Thing("human", BOX),)),), ("human",))
    with pytest.raises(ConfigError, match="--rename LABEL=CLASS"):
        evaluated(people, [])
    renamed = people.renamed({"human": "person"})
    assert evaluated(renamed, [Detection(BOX, "person", 0.9)]).overall.recall == 1
    with pytest.raises(ConfigError, match="no label man; it has human"):
        people.renamed({"man": "person"})


@pytest.mark.parametrize(
    ("label", "problem"),
    [("unicorn", "--rename LABEL=CLASS"), ("person", r"cannot read .*gone\.png")],
)
def test_what_cannot_be_measured_is_refused_before_any_picture(
    tmp_path: Path, label: str, problem: str
) -> None:
    """No label in common, or a later picture that is not there."""
    cv2.imwrite(str(tmp_path / "here.png"), np.zeros((96, 128, 3), np.uint8))
    detector = OnnxDetector(patchwork_model(tmp_path / "a.onnx", shape=(1, 3, 96, 128)))
    detector.open()
    things = (Thing(label, BOX),)
    pictures = [AnnotatedPicture(tmp_path / name, things) for name in ("here.png", "gone.png")]
    seen: list[None] = []
    with pytest.raises(ConfigError, match=problem):
        evaluate(detector, Dataset(tuple(pictures), (label,)), progress=lambda: seen.append(None))
    assert not seen


def test_labels_that_the_model_does_not_know_are_named() -> None:
    """They are left out of every figure."""
    truth = Dataset(
        (AnnotatedPicture(Path("a.png"), (Thing("dog", BOX), Thing("car", BOX))),), ("dog", "car")
    )
    result = evaluated(truth, [Detection(BOX, "car", 0.9)])
    assert result.left_out == ("dog",)
    assert (result.overall.recall, result.overall.precision) == (1, 1)


@given(seed=st.integers(0, 2**31))
@settings(max_examples=8, deadline=None)
def test_average_precision_is_what_pycocotools_gives_for_the_same_files(seed: int) -> None:
    """Through its own way of reading annotations and results, sizes and crowds included."""
    rng = np.random.default_rng(seed)
    things, found = [], []
    for _ in range(6):
        corners = rng.uniform(0, 300, (8, 2))
        boxes = np.hstack(
            [corners, corners + rng.choice([12, 50, 150], (8, 1)) * rng.uniform(0.7, 1, (8, 2))]
        )
        kinds = rng.choice(["person", "car"], 8)
        things.append(
            [
                Thing(str(k), tuple(b), bool(rng.random() < 0.1))
                for k, b in zip(kinds, boxes.tolist(), strict=True)
            ]
        )
        moved = boxes + rng.normal(0, 3, boxes.shape)
        found.append(
            [
                Detection(tuple(b), str(k), float(rng.random()))
                for k, b in zip(kinds, moved.tolist(), strict=True)
                if b[2] > b[0] and b[3] > b[1] and rng.random() < 0.8
            ]
        )
    ours = evaluated(dataset(*things), *found).overall
    theirs = reference(things, found)
    assert (ours.ap, ours.ap50) == pytest.approx(theirs[:2])
    for mine, other in zip(
        (ours.ap_small, ours.ap_medium, ours.ap_large), theirs[3:6], strict=True
    ):
        assert other == -1 if math.isnan(mine) else mine == pytest.approx(other)


def reference(things: list[list[Thing]], found: list[list[Detection]]) -> list[float]:
    """`COCOeval.stats`, as its demo computes it."""
    number = {"person": 7, "car": 3}

    def entry(picture: int, label: str, box: Box) -> dict[str, object]:
        wide, high = box[2] - box[0], box[3] - box[1]
        bbox = [box[0], box[1], wide, high]
        return {
            "image_id": picture,
            "category_id": number[label],
            "bbox": bbox,
            "area": wide * high,
        }

    truth = coco.COCO()
    truth.dataset = {
        "info": {},
        "images": [{"id": 100 + n} for n in range(len(things))],
        "categories": [{"id": value, "name": key} for key, value in number.items()],
        "annotations": [
            entry(100 + n, one.label, one.box)
            | {"id": 1000 * (n + 1) + k, "iscrowd": int(one.ignored)}
            for n, picture in enumerate(things)
            for k, one in enumerate(picture)
        ],
    }
    results = [
        entry(100 + n, one.label, one.box) | {"score": one.score}
        for n, picture in enumerate(found)
        for one in picture
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        truth.createIndex()
        run = cocoeval.COCOeval(truth, truth.loadRes(results), "bbox")
        run.evaluate()
        run.accumulate()
        run.summarize()
    return [float(one) for one in run.stats]
