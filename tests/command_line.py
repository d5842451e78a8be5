"""The command line, run in the tests' own process."""

from __future__ import annotations

import sys
from typing import NamedTuple

import pytest

from aerodaas.cli.app import main

__all__ = ["Ended", "exit_code", "ran"]


class Ended(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    said: str
    """On standard error."""


def exit_code(*words: str) -> int:
    """Run `aerodaas` with these words; returns its exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["aerodaas", *words])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def ran(capture: pytest.CaptureFixture[str], *words: str) -> Ended:
    """Run `aerodaas` with these words, which must end without a traceback."""
    capture.readouterr()
    code = exit_code(*words)
    told = capture.readouterr()
    assert "Traceback" not in told.out + told.err
    return Ended(code, told.out, told.err)
