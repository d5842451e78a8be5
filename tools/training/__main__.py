"""The command line of `python -m tools.training`."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import cv2
import typer
from rich.console import Console
from rich.progress import Progress

from aerodaas.analytics.models import DETECTOR
from tools.training import gestures
from tools.training.rendering import HELD_OUT, render_shards
from tools.training.sheet import contact_sheet

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False)
_console = Console()

_Work = Annotated[Path, typer.Option(help="Folder of pictures and checkpoints.")]
_Out = Annotated[Path, typer.Option(help="Folder of the models and their cards.")]
_Worlds = Annotated[int, typer.Option(help="Worlds to train on, of 20 pictures each.")]
_Steps = Annotated[int, typer.Option(help="Steps of training.")]
_Batch = Annotated[int, typer.Option(min=1, help="Pictures of each step.")]
_Loaders = Annotated[
    int, typer.Option(min=0, help="Processes that draw pictures ahead: one per core, for a GPU.")
]
_Renderers = Annotated[int, typer.Option(min=1, help="Processes that render.")]
_Yolox = Annotated[
    Path, typer.Option(help="YOLOX-nano's weights: Megvii's file, or a detector made of it.")
]
_Seed = Annotated[int, typer.Option(help="Seed of weights and order.")]
_Start = Annotated[
    Path | None,
    typer.Option(help="Weights to begin with: an earlier run's weights.pt, or a detector.onnx."),
]
_Rate = Annotated[float, typer.Option(help="Highest rate of learning.")]
_Kept = Annotated[
    float,
    typer.Option(min=0, max=1, help="Share of a --start that is an .onnx in what is exported."),
]
_Processes = Annotated[
    int, typer.Option(min=1, help="Processes that share each step, one per core at best.")
]
_Photographs = Annotated[Path | None, typer.Option(help="Photographs to try the detector on.")]
_Labels = Annotated[
    Path | None, typer.Option(help="Their vests: JSON, {file: [left, top, right, bottom]}.")
]
_WORK, _OUT = Path("runs/training"), DETECTOR.parent


@app.command()
def render(
    work: _Work = _WORK, worlds: _Worlds = 1400, held_out: int = 30, renderers: _Renderers = 1
) -> None:
    """Render the pictures, those to train on and those held out; resumes."""
    for name, first, count in (("train", 0, worlds), ("held-out", HELD_OUT, held_out)):
        with Progress(console=_console) as bar:
            task = bar.add_task(f"rendering {name}", total=count)
            for done in render_shards(work / name, first, count, renderers):
                bar.update(task, completed=done)


@app.command()
def sheet(path: Path, seed: int = HELD_OUT) -> None:
    """Write a contact sheet of labelled renders to PATH (.jpg or .png)."""
    cv2.imwrite(str(path), contact_sheet(seed))


@app.command()
def detector(
    work: _Work = _WORK,
    out: _Out = _OUT,
    worlds: _Worlds = 1400,
    steps: _Steps = 8000,
    batch: _Batch = 96,
    seed: _Seed = 1,
    start: _Start = None,
    rate: _Rate = 2e-3,
    kept: _Kept = 0.0,
    processes: _Processes = 1,
    loaders: _Loaders = 0,
    renderers: _Renderers = 1,
    yolox: _Yolox = DETECTOR,
    photographs: _Photographs = None,
    labels: _Labels = None,
) -> None:
    """Render, train, export and measure the detector of vests, people, cars and towers."""
    _require_torch()
    from tools.training import pipeline, train  # noqa: PLC0415 - they need PyTorch

    render(work, worlds, renderers=renderers)
    places = pipeline.Places(work, out, photographs, labels, yolox)
    recipe = train.Recipe(
        steps=steps,
        batch=batch,
        rate=rate,
        seed=seed,
        start=start,
        kept=kept,
        processes=processes,
        loaders=loaders,
    )
    _watch(pipeline.trained(places, recipe), steps)
    _console.print(pipeline.make_detector(places, recipe).figures)


@app.command()
def pose(
    work: _Work = _WORK,
    out: _Out = _OUT,
    worlds: _Worlds = 600,
    steps: _Steps = 4000,
    seed: _Seed = 1,
    processes: _Processes = 1,
) -> None:
    """The same for the keypoints of people, which learn from cuts around them."""
    _require_torch()
    from tools.training import pipeline, pose_pipeline, pose_train  # noqa: PLC0415

    render(work, worlds)
    places = pipeline.Places(work, out)
    recipe = pose_train.PoseRecipe(steps=steps, seed=seed, processes=processes)
    _watch(pose_pipeline.trained_pose(places, recipe), steps)
    _console.print(pose_pipeline.make_pose(places, recipe).figures)


app.command("gestures")(gestures.main)


def _require_torch() -> None:
    missing = [name for name in ("torch", "onnx") if importlib.util.find_spec(name) is None]
    if missing:
        _console.print(
            f"training needs {' and '.join(missing)}: pip install 'aerodaas[training]'",
            markup=False,
        )
        raise typer.Exit(1)


def _watch(progress: Iterator[object], steps: int) -> None:
    for state in progress:
        _console.print(f"{state} of {steps} steps")


if __name__ == "__main__":
    app(prog_name="python -m tools.training")
