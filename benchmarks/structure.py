"""The size and shape of the product: lines, modules and packages, by folder.

    python benchmarks/structure.py [CHECKOUT]

Every line of every Python file counts, links followed once. The workshop in `tools/` is counted
apart. The contracts on imports are checked by `lint-imports`.
"""

from __future__ import annotations

import statistics
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from _report import Report

ROOT = Path(__file__).resolve().parent.parent


def modules(folder: Path) -> dict[Path, int]:
    """Lines of each Python file below `folder`."""
    return {
        path: len(path.read_text(encoding="utf-8").splitlines())
        for path in sorted(folder.rglob("*.py"))
        if "__pycache__" not in path.parts
    }


def shape(files: dict[Path, int]) -> dict[str, float]:
    """The figures of a set of files."""
    packages = Counter(path.parent for path in files if path.name != "__init__.py")
    return {
        "size": sum(files.values()) / 1000,
        "modules": len(files),
        "median": statistics.median(files.values()),
        "longest": max(files.values()),
        "fullest": max(packages.values(), default=0),
    }


def main(
    checkout: Annotated[Path, typer.Argument(help="Another checkout.", show_default="this")] = ROOT,
) -> None:
    """Print the figures of this checkout, or of the one named."""
    root = checkout.resolve()
    units = {
        "size": "1000 lines",
        "modules": "files",
        "median": "lines",
        "longest": "lines",
        "fullest": "modules in a package",
    }
    report = Report("structure", units)
    folders = [root / "actors", root / "schedulers"]
    folders += [path for path in sorted((root / "aerodaas").iterdir()) if path.is_dir()]
    product: dict[Path, int] = {}
    for folder in folders:
        if not folder.is_symlink() and (files := modules(folder)):
            report.row(folder.name, shape(files))
            product |= files
    product |= {path: n for path, n in modules(root / "aerodaas").items() if path not in product}
    report.row("product", shape(product))
    if workshop := modules(root / "tools"):
        report.row("tools", shape(workshop))
    longest = max(product, key=lambda path: product[path])
    stub = (root / "aerodaas" / "__init__.pyi").read_text(encoding="utf-8")
    report.note(f"longest: {longest.relative_to(root)}; public names: {stub.count(' as ')}")
    report.show()


if __name__ == "__main__":
    typer.run(main)
