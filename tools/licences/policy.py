"""Licences that users of an Apache-2.0 project can live with, and the explained exceptions."""

from __future__ import annotations

import re

__all__ = ["ACCEPTED", "EXCEPTIONS", "is_accepted"]

ACCEPTED = {
    *("0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "ISC", "MIT", "MIT-0"),
    *("MIT-CMU", "PSF-2.0", "Unlicense", "Zlib"),
    "any-OSI",  # any that the Open Source Initiative approves: the choice has MIT among it
    "MPL-2.0",  # asks for the sources of its own files only, which are used unchanged
}
"""SPDX ids."""

EXCEPTIONS = {
    ("pymavlink", "LGPL-3.0-only"): (
        "a library of its own that pip installs and any user may replace, which is what the LGPL "
        "asks; it is neither changed nor copied into the wheel"
    ),
    ("av", "GPL-2.0-or-later"): (
        "PyAV is BSD-3-Clause, but its binary wheels carry x264 and x265 beside FFmpeg (LGPL). "
        "Using them asks for nothing; passing an image with the wheel on to others asks for the "
        "GPL's terms, or for PyAV built against an FFmpeg without them (pip install --no-binary av)"
    ),
}
"""Why a distribution's licence is lived with, by its name and the SPDX id."""


def is_accepted(expression: str) -> bool:
    """Whether an SPDX expression leaves a choice of accepted licences only.

    Parentheses are not read: such an expression is not accepted, so that a person looks at it.
    """
    return any(
        all(part.strip() in ACCEPTED for part in re.split(r"\bAND\b", choice))
        for choice in re.split(r"\bOR\b", expression)
    )
