"""The command tells what is missing, and draws what it would train on."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner

from tools.training.__main__ import app


@pytest.mark.parametrize("model", ["detector", "pose"])
def test_without_pytorch_the_remedy_is_told(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is rendered."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)  # noqa: ARG005
    result = CliRunner().invoke(app, [model])
    assert result.exit_code == 1
    assert "pip install 'aerodaas[training]'" in result.output


def test_a_contact_sheet_is_written(tmp_path: Path) -> None:
    """Twenty pictures, to be looked at."""
    path = tmp_path / "sheet.png"
    assert CliRunner().invoke(app, ["sheet", str(path)]).exit_code == 0
    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape == (1560, 1664, 3)
