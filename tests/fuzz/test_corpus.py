"""What fuzzing found once is found no more, and a moment of it finds nothing new."""

from __future__ import annotations

import os

import pytest

from tools.fuzz.campaign import fuzz
from tools.fuzz.target import CORPUS, load_target, target_names

_SECONDS = float(os.environ.get("AERODAAS_FUZZ_SECONDS", "0.3"))


_SLOW = frozenset({"agents"})
"""Targets with a whole service behind them."""


@pytest.mark.parametrize(
    "target",
    [
        pytest.param(name, marks=pytest.mark.slow) if name in _SLOW else name
        for name in target_names()
    ],
)
def test_seeds_corpus_and_a_short_run_are_taken(target: str) -> None:
    """Every input that is known, as it is, and as many mutations as there is time for."""
    result = fuzz(target, seconds=_SECONDS)
    if result.findings:
        found = result.findings[0]
        pytest.fail(
            f"{len(result.findings)} findings, the first: {found.title}\n{found.data!r:.2000}\n"
            f"{found.trace}\nSee docs/testing.md, Fuzzing."
        )
    assert result.inputs >= len(load_target(target).pool())


def test_the_corpus_belongs_to_targets() -> None:
    """No folder is left behind by a target that is gone."""
    assert {folder.name for folder in CORPUS.glob("*")} <= set(target_names())
