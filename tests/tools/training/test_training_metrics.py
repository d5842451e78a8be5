"""Average precision and the best threshold, on cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tools.training.metrics import Ranking, overlap, similarity, strays

ALL = np.ones(2, dtype=bool)


def test_overlap_of_boxes() -> None:
    """Itself, a half-shifted one, and one apart."""
    boxes = np.array([[0, 0, 10, 10], [5, 0, 15, 10], [20, 20, 30, 30]], dtype=float)
    assert overlap(boxes[:1], boxes)[0] == pytest.approx([1.0, 1 / 3, 0.0])


def test_a_false_box_before_the_second_thing_costs_a_sixth() -> None:
    """Precision is 1 up to half the things, and 2/3 for the rest."""
    ranking = Ranking([], [])
    ranking.add(np.array([0.9, 0.8, 0.7]), np.array([[1, 0], [0, 0], [0, 1.0]]), ALL)
    assert ranking.average_precision == pytest.approx((51 + 50 * 2 / 3) / 101)


def test_a_box_is_astray_if_its_middle_is_on_nothing() -> None:
    """However large it is, and whether or not another box is there already."""
    boxes = np.array([[0, 0, 10, 10], [-20, -20, 30, 30], [8, 8, 20, 20]], dtype=float)
    assert strays(boxes, np.array([[4, 4, 12, 12.0]])).tolist() == [False, False, True]
    assert strays(boxes, np.zeros((0, 4))).all()


def test_a_thing_found_twice_counts_once() -> None:
    """The second box is a false one."""
    ranking = Ranking([], [])
    ranking.add(np.array([0.9, 0.8]), np.array([[1.0], [0.9]]), ALL[:1])
    assert ranking.hits == [True, False]


def test_what_need_not_be_found_neither_helps_nor_harms() -> None:
    """Small things."""
    ranking = Ranking([], [])
    ranking.add(np.array([0.9, 0.8]), np.eye(2), np.array([True, False]))
    assert ranking.hits == [True]
    assert ranking.things == 1


def test_keypoints_are_alike_by_the_size_of_the_person() -> None:
    """The same pixels off matter less for a larger person; hidden outside ones do not count."""
    truth = np.zeros((2, 17, 3))
    truth[..., 2] = 2
    found = truth[:1].copy()
    found[..., 0] += 5.0
    small, large = similarity(found, truth, np.array([900.0, 90_000.0]))[0]
    assert small < 0.5 < large < 1.0
    truth[0, 1:, 2] = 0
    found[:, 0] = truth[:1, 0]
    assert similarity(found, truth, np.array([900.0, 900.0]))[0, 0] == pytest.approx(1.0)
