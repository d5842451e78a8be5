"""`aerodaas models evaluate`: a detector measured on annotated pictures."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodaas.types.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.analytics.evaluation.figures import ClassFigures, Evaluation

__all__ = ["evaluate_model"]

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


def evaluate_model(
    model: Annotated[str, typer.Argument(help="An ONNX file, or a model's name.")],
    dataset: Annotated[
        Path,
        typer.Argument(
            help="Annotations: COCO's .json, YOLO's data.yaml or folder, or VOC's folder."
        ),
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

        aerodaas models evaluate yolox-nano instances_val2017.json --pictures val2017
        aerodaas models evaluate mine.onnx campus/data.yaml --worst mistakes --csv campus.csv
        aerodaas models evaluate mine.onnx VOC2012 --rename human=person
    """
    from aerodaas.config.extras import require_extra  # noqa: PLC0415 - slow to load

    require_extra("evaluation", "the evaluation of models")
    from aerodaas.analytics.detection.detector import OnnxDetector  # noqa: PLC0415
    from aerodaas.analytics.evaluation.errors import draw_mistakes  # noqa: PLC0415
    from aerodaas.analytics.evaluation.figures import LEAST_SCORE, evaluate  # noqa: PLC0415
    from aerodaas.analytics.evaluation.reading import read_dataset  # noqa: PLC0415
    from aerodaas.terminal.progress import show_progress  # noqa: PLC0415

    if not LEAST_SCORE <= min_score <= 1:
        raise ConfigError(f"--min-score lies between {LEAST_SCORE} and 1, not at {min_score}")
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
    if out_json is not None:
        _write(out_json, json.dumps(_plain(result, model, dataset), indent=2) + "\n")
    if out_csv is not None:
        _write_csv(out_csv, result)
    if worst is not None:
        files = draw_mistakes(result.mistakes, worst, most)
        typer.echo(f"{len(files)} pictures of mistakes in {worst}")


def _renames(texts: Sequence[str]) -> dict[str, str]:
    pairs = [text.partition("=") for text in texts]
    if not all(old and new for old, _, new in pairs):
        raise ConfigError("a label is renamed as --rename LABEL=CLASS")
    return {old: new for old, _, new in pairs}


def _show(result: Evaluation, title: str) -> None:
    from aerodaas.config.printable import printable  # noqa: PLC0415 - slow to load
    from aerodaas.terminal.figures import Row, show_figures  # noqa: PLC0415

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


def _plain(result: Evaluation, model: str, dataset: Path) -> Any:  # noqa: ANN401 - JSON
    content = dataclasses.asdict(dataclasses.replace(result, mistakes=()))
    content.pop("mistakes")
    return _without_nan({"model": model, "dataset": str(dataset), **content})


def _without_nan(value: Any) -> Any:  # noqa: ANN401 - JSON, which has no NaN
    if isinstance(value, float) and math.isnan(value):
        return None
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(one) for one in value]
    return value


def _write_csv(path: Path, result: Evaluation) -> None:
    rows = [dataclasses.asdict(one) for one in (*result.classes, result.overall)]
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(
                {key: "" if value != value else value for key, value in row.items()}  # noqa: PLR0124 - NaN
                for row in rows
            )
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from None


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from None
