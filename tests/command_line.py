"""The command line, run in the tests' own process."""

from __future__ import annotations

import sys

import pytest

from aerodaas.cli.app import main

__all__ = ["exit_code"]


def exit_code(*words: str) -> int:
    """Run `aerodaas` with these words; returns its exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["aerodaas", *words])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)
