"""Users of an Apache-2.0 project can live with the licences of what it needs."""

from __future__ import annotations

from importlib.metadata import Distribution
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from tools.licences.policy import EXCEPTIONS, is_accepted
from tools.licences.reading import installed_licences, licence_of


def test_what_flying_needs_is_accepted_or_explained() -> None:
    """All extras included, and what the requirements require."""
    runtime = [one for one in installed_licences() if one.runtime]
    assert {"ray", "numpy", "pymavlink", "fastapi", "msgpack"} <= {one.name for one in runtime}
    assert not {one.name: one.objections for one in runtime if one.objections}


def test_what_only_development_needs_is_listed_and_told_apart() -> None:
    """It goes to no user."""
    kinds = {one.name: one.runtime for one in installed_licences()}
    assert kinds["pytest"] is False
    assert kinds["ray"] is True
    assert "aerodaas" not in kinds


@pytest.mark.slow
def test_no_exception_outlives_its_reason() -> None:
    """Each is for a licence that a dependency has."""
    used = {
        (one.name, spdx) for one in installed_licences() for spdx in (one.expression, *one.carried)
    }
    assert set(EXCEPTIONS) <= used
    assert all(canonicalize_name(name) == name for name, _ in EXCEPTIONS)


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ([("License-Expression", "MIT OR GPL-3.0-only")], "MIT OR GPL-3.0-only"),
        ([("License", "Apache License, Version 2.0")], "Apache-2.0"),
        ([("License", "MPL-2.0 AND MIT")], "MPL-2.0 AND MIT"),
        ([("License", "GPLv2")], "GPL-2.0-only"),
        ([("License", "EPL-2.0, BSD-3-Clause")], "EPL-2.0 OR BSD-3-Clause"),
        ([("License", "MIT License\n        \n        Permission is granted")], "MIT"),
        ([("License", "Our own\n        MIT License")], "unknown"),
        ([("License", "All rights reserved, ask us")], "unknown"),
        ([("License", "UNKNOWN")], "unknown"),
        ([("Classifier", "License :: OSI Approved :: MIT License")], "MIT"),
        ([("Classifier", "Topic :: Software"), ("License", "")], "unknown"),
    ],
)
def test_a_licence_is_read_from_old_and_new_metadata(
    tmp_path: Path, headers: list[tuple[str, str]], expected: str
) -> None:
    """What cannot be read is unknown, which is not accepted."""
    folder = tmp_path / "thing-1.dist-info"
    folder.mkdir()
    lines = [("Metadata-Version", "2.4"), ("Name", "thing"), ("Version", "1"), *headers]
    folder.joinpath("METADATA").write_text("".join(f"{key}: {value}\n" for key, value in lines))
    assert licence_of(Distribution.at(folder), runtime=True).expression == expected


@pytest.mark.parametrize(
    ("expression", "accepted"),
    [
        ("MIT", True),
        ("Apache-2.0 AND MIT", True),
        ("GPL-3.0-only OR MIT", True),
        ("any-OSI", True),
        ("GPL-3.0-only", False),
        ("MIT AND GPL-3.0-only", False),
        ("(MIT)", False),
        ("unknown", False),
        ("", False),
    ],
)
def test_one_choice_must_be_accepted_whole(expression: str, accepted: bool) -> None:  # noqa: FBT001
    """AND binds more strongly than OR."""
    assert is_accepted(expression) is accepted
