"""The fuzzing harness tells an input that reaches a new line, however often others did not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import aerodaas
from tools.fuzz.coverage import Coverage

_SOURCE = """
def hot(number):
    if number == 1:
        return "rare"
    return "common"
"""


def _function(folder: Path) -> Callable[[int], str]:
    names: dict[str, Callable[[int], str]] = {}
    exec(compile(_SOURCE, str(folder / "hot.py"), "exec"), names)  # noqa: S102
    return names["hot"]


def _watched(coverage: Coverage, run: Callable[[int], str], number: int, times: int = 1) -> bool:
    with coverage.watch():
        for _ in range(times):
            run(number)
    return coverage.grew


def test_only_new_lines_of_ours_count() -> None:
    """Not those of a library, and each once."""
    ours, theirs = _function(Path(aerodaas.__file__).parent), _function(Path("/elsewhere"))
    coverage = Coverage()
    assert _watched(coverage, ours, 0)
    assert not _watched(coverage, ours, 0)
    assert _watched(coverage, ours, 1)
    assert not _watched(coverage, theirs, 0)


@pytest.mark.parametrize(("before", "share"), [(200, 1), (1000, 4), (5000, 16)])
def test_after_many_inputs_a_new_line_is_still_told(before: int, share: int) -> None:
    """Within as many calls and inputs as are left out at a time; that of a new function, too."""
    ours, new = (_function(Path(aerodaas.__file__).parent) for _ in range(2))
    coverage = Coverage()
    for _ in range(before):
        _watched(coverage, ours, 0, times=5)
    assert not coverage.grew
    for function, number, times in ((ours, 1, 16), (new, 0, 1)):
        told = [_watched(coverage, function, number, times) for _ in range(share)]
        assert sum(told) == 1
