"""What fuzzing found once is found no more, and a second of it finds nothing new."""

from __future__ import annotations

import os

import pytest

from tools.fuzz.campaign import Result, fuzz, replay
from tools.fuzz.target import CORPUS, target_names

_SECONDS = float(os.environ.get("AERODAAS_FUZZ_SECONDS", "1.5"))


@pytest.mark.parametrize("target", target_names())
def test_the_corpus_is_taken(target: str) -> None:
    """Every input of the corpus, as it is."""
    files = sorted(CORPUS.joinpath(target).glob("*"))
    result = replay(target, [file.read_bytes() for file in files])
    assert result.inputs == len(files)
    _expect_none(result)


@pytest.mark.parametrize("target", target_names())
def test_a_short_run_finds_nothing(target: str) -> None:
    """Seeds, corpus, and as many mutations as there is time for."""
    result = fuzz(target, seconds=_SECONDS)
    assert result.inputs
    _expect_none(result)


def test_the_corpus_belongs_to_targets() -> None:
    """No folder is left behind by a target that is gone."""
    assert {folder.name for folder in CORPUS.glob("*")} <= set(target_names())


def _expect_none(result: Result) -> None:
    if result.findings:
        found = result.findings[0]
        pytest.fail(
            f"{len(result.findings)} findings, the first: {found.title}\n{found.data!r:.2000}\n"
            f"{found.trace}\nSee docs/testing.md, Fuzzing."
        )
