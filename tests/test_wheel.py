"""What people install holds all that a checkout has, the linked folders and the models, too."""

from __future__ import annotations

import zipfile
from pathlib import Path

from hatchling.builders.wheel import WheelBuilder

_ROOT = Path(__file__).resolve().parents[1]


def test_the_wheel_holds_the_package_its_links_and_its_data(tmp_path: Path) -> None:
    """Code behind links once, models, worlds, types and the report's looks."""
    (built,) = WheelBuilder(str(_ROOT)).build(directory=str(tmp_path), versions=["standard"])
    names = zipfile.ZipFile(built).namelist()
    assert len(names) == len(set(names))
    package = _ROOT / "aerodaas"
    kinds = ("*.py", "*.pyi", "*.json", "*.onnx", "*.css", "py.typed")
    wanted = {
        f"aerodaas/{path.relative_to(package)}"
        for folder in (package, package / "actors", package / "schedulers")
        for kind in kinds
        for path in folder.rglob(kind)
    }
    assert any(name.endswith(".onnx") for name in wanted)
    assert wanted <= set(names)
