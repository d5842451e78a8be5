"""Measure a detector on annotated pictures: `python -m tools.evaluation`."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.cli.app import run_typer
from aerodaas.cli.lab.options import write_csv
from aerodaas.config.extras import require_extra
from aerodaas.errors import ConfigError
from aerodaas.recording.encoding import plain
from aerodaas.terminal.figures import Row, show_figures
from aerodaas.terminal.progress import show_progress
from aerodaas.text.printable import printable
from tools.evaluation.errors import draw_mistakes
from tools.evaluation.figures import LEAST_SCORE, ClassFigures, Evaluation, evaluate

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)

_COLUMNS = {
    "things": "things",
    "ap50": "AP50",
    "ap": "AP50-95",
    "ap_small": "small",
    "ap_medium": "medium",
    "ap_large": "large",
    "recall": "recall",
    "precision": "precision",
    "false_per_picture": "false boxes a picture",
    "false_alarms": "pictures without, with a false box",
    "calibration_error": "calibration error",
}


@app.command()
def main(
    model: Annotated[str, typer.Argument(help="An ONNX file, or a model's name.")],
    dataset: Annotated[
        Path,
        typer.Argument(help="Annotations: COCO's .json, or YOLO's data.yaml or folder."),
    ],
    pictures: Annotated[
        Path | None, typer.Option(help="Folder of the pictures, where it is not beside.")
    ] = None,
    rename: Annotated[
        list[str] | None,
        typer.Option(metavar="LABEL=CLASS", help="The model's word for a label of the dataset."),
    ] = None,
    min_score: Annotated[
        float, typer.Option(help="Score at which boxes fly: of recall, precision, false boxes.")
    ] = 0.3,
    out_json: Annotated[
        Path | None, typer.Option("--json", help="Write all figures to this file.")
    ] = None,
    out_csv: Annotated[
        Path | None, typer.Option("--csv", help="Write a row for each class to this file.")
    ] = None,
    worst: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw the worst mistakes into this.")
    ] = None,
    most: Annotated[int, typer.Option(min=1, help="Most pictures of mistakes.")] = 20,
    threads: Annotated[
        int | None, typer.Option(min=1, help="onnxruntime's threads. Default: half of the cores.")
    ] = None,
) -> None:
    """Measure a detector on annotated pictures, by COCO's own evaluation.

    Average precision counts boxes of 0.01 and more, all else those of --min-score.

        python -m tools.evaluation yolox-nano instances_val2017.json --pictures val2017
        python -m tools.evaluation mine.onnx campus/data.yaml --worst mistakes --csv campus.csv
        python -m tools.evaluation mine.onnx campus/data.yaml --rename human=person
    """
    require_extra("evaluation", "the evaluation of models")
    from tools.evaluation.reading import read_dataset  # noqa: PLC0415 - imports the extra

    if not LEAST_SCORE <= min_score <= 1:
        raise ConfigError(f"--min-score lies between {LEAST_SCORE} and 1, not at {min_score}")
    _require_places([path for path in (out_json, out_csv) if path is not None], worst)
    annotated = read_dataset(dataset, pictures).renamed(_renames(rename or ()))
    detector = OnnxDetector(model, min_score=LEAST_SCORE, threads=threads)
    detector.open()
    with show_progress() as shown:
        bar = shown.add_task("pictures", total=len(annotated.pictures))
        result = evaluate(
            detector, annotated, min_score=min_score, progress=lambda: shown.advance(bar)
        )
    detector.close()
    _show(result, f"{model} on {dataset}")
    if out_json is not None or out_csv is not None:
        _write(result, model, dataset, out_json, out_csv)
    if worst is not None:
        files = draw_mistakes(result.mistakes, worst, most)
        typer.echo(f"{len(files)} pictures of mistakes in {worst}")


def _require_places(files: Sequence[Path], folder: Path | None) -> None:
    """Refuse what could not be written before an evaluation, which may take hours."""
    for path in files:
        place = path if path.exists() else path.parent
        if path.is_dir() or not os.access(place, os.W_OK):
            raise ConfigError(f"cannot write {path}: name a file in a folder that you may write")
    if folder is not None:
        with _writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise ConfigError(f"cannot write into {folder}: name a folder that you may write")


def _renames(texts: Sequence[str]) -> dict[str, str]:
    pairs = [text.partition("=") for text in texts]
    if not all(old and new for old, _, new in pairs):
        raise ConfigError("a label is renamed as --rename LABEL=CLASS")
    return {old: new for old, _, new in pairs}


def _show(result: Evaluation, title: str) -> None:
    rows = [Row(printable(one.label), _cells(one)) for one in result.classes if one.things]
    rows += [Row(printable(one.label), _cells(one)) for one in result.classes if not one.things]
    rows.append(Row("all", _cells(result.overall), bold=True))
    head = f"{printable(title)}: {result.pictures} pictures, boxes of {result.min_score:g} and more"
    show_figures(head, "class", list(_COLUMNS.values()), rows)
    bins = [
        Row(f"{one.low:.1f} to {one.high:.1f}", [str(one.boxes), _n(one.score), _n(one.right)])
        for one in result.reliability
        if one.boxes
    ]
    show_figures("what a score means", "score", ("boxes", "mean score", "right"), bins)
    if result.left_out:
        labels = printable(", ".join(result.left_out))
        typer.echo(f"not evaluated, for the model does not know them: {labels}")


def _cells(row: ClassFigures) -> list[str]:
    return [_n(getattr(row, name)) for name in _COLUMNS]


def _n(value: float) -> str:
    if isinstance(value, int):
        return str(value)
    return "" if math.isnan(value) else f"{value:.3f}"


def _write(
    result: Evaluation, model: str, dataset: Path, out_json: Path | None, out_csv: Path | None
) -> None:
    figures = dataclasses.asdict(dataclasses.replace(result, mistakes=()))
    del figures["mistakes"]
    content = plain({"model": model, "dataset": str(dataset), **figures})
    if out_json is not None:
        with _writing(out_json):
            out_json.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    if out_csv is not None:
        with _writing(out_csv):
            write_csv(out_csv, [*content["classes"], content["overall"]])


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from None


if __name__ == "__main__":
    run_typer(app, "python -m tools.evaluation")
