"""The fuzzing harness tells an input that reaches a new line, however often others did not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

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


def test_a_function_called_often_still_tells_a_new_line() -> None:
    """Within as many calls and inputs as are left out at a time."""
    ours = _function(Path(aerodaas.__file__).parent)
    coverage = Coverage()
    for _ in range(1000):
        _watched(coverage, ours, 0, times=5)
    assert not coverage.grew
    assert any([_watched(coverage, ours, 1, times=16) for _ in range(4)])  # noqa: C419 - all of them
    assert _watched(coverage, _function(Path(aerodaas.__file__).parent), 0)
