"""`aerodaas models`: what there is, what was fetched, whether a file works, and how well."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.options import ExampleGroup
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from aerodaas.analytics.detection.detector import OnnxDetector

__all__ = ["app"]

_SHOWN_CLASSES = 8

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Detectors and pose models: fetch by name, try, and measure.

    aerodaas models list
    aerodaas models add yolox-nano
    aerodaas models check my_detector.onnx
""",
)


@app.command("list")
def list_models() -> None:
    """List the models that have names, and which of them are here.

    aerodaas models list
    """
    from aerodaas.analytics.models.cache import fetched_path, model_folder  # noqa: PLC0415
    from aerodaas.analytics.models.registry import REGISTRY  # noqa: PLC0415 - only here
    from aerodaas.terminal.figures import Row, show_figures  # noqa: PLC0415 - slow to load

    rows = [
        Row(
            model.name,
            [
                model.finds,
                "{} x {}".format(*model.input),
                f"{model.download / 1e6:.1f} MB",
                model.licence,
                model.published,
                "yes" if fetched_path(model).is_file() else "",
            ],
        )
        for model in REGISTRY.values()
    ]
    columns = ("finds", "input", "to fetch", "licence", "published by its authors", "here")
    show_figures("models by name", "name", columns, rows)
    typer.echo(f"`aerodaas models add NAME` fetches one into {model_folder()}.")
    typer.echo("The detector and the pose model that ship are there without.")


@app.command()
def add(
    names: Annotated[list[str], typer.Argument(metavar="NAME…", help="From `models list`.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="ADDRESS|FILE",
            help="Another place than the model's release: a mirror's address of the file, or of "
            "the folder with it (ending in /), or a file on this machine.",
        ),
    ] = None,
) -> None:
    """Fetch models by name, once; their checksums are verified before anything reads them.

    What is cut off goes on where it ended when the command is given again.

        aerodaas models add yolox-nano
        aerodaas models add yolox-s --from https://mirror.example/models/
        aerodaas models add yolox-s --from ~/Downloads/yolox_s.onnx
    """
    from aerodaas.analytics.models.fetching import fetch_model  # noqa: PLC0415 - slow to load
    from aerodaas.analytics.models.registry import registered  # noqa: PLC0415
    from aerodaas.terminal.progress import download_view  # noqa: PLC0415

    for model in [registered(name) for name in names]:
        with download_view(shown=True, what=model.name) as progress:
            path = fetch_model(model.name, source, progress=progress)
        typer.echo(f"{model.name}: {path} ({model.licence})")


@app.command()
def check(
    model: Annotated[str, typer.Argument(help="An ONNX file, or a model's name.")],
) -> None:
    """Tell what a model is, what it gave in a trial, and how to use it.

    A file that is no detector, or cannot work as one, is refused as an application refuses it.

        aerodaas models check my_detector.onnx
        aerodaas models check yolox-nano
    """
    from aerodaas.analytics.detection.detector import OnnxDetector  # noqa: PLC0415 - slow to load
    from aerodaas.analytics.detection.keypoints import keypoint_head  # noqa: PLC0415
    from aerodaas.analytics.detection.model_file import read_model  # noqa: PLC0415

    head = keypoint_head(read_model(model))
    if head is not None:
        width, height = head.size
        lines = [
            f"{model}: a keypoint network on crops around people ({type(head).__name__})",
            f"input     crops of {width} x {height}",
            "keypoints 17, COCO's",
            f"use       PoseAnalytics({model!r})",
        ]
    else:
        lines = _told(model, OnnxDetector(model, threads=1))
    for line in lines:
        typer.echo(printable(line))


def _told(model: str, detector: OnnxDetector) -> list[str]:
    style, trial = detector.style, detector.trial
    order = "RGB" if style.rgb else "BGR"
    fit = "stretched" if style.stretched else "padded"
    width, height = detector.size[1], detector.size[0]
    first = ", ".join(detector.names[:_SHOWN_CLASSES])
    more = "" if len(detector.names) <= _SHOWN_CLASSES else ", …"
    keypoints = getattr(detector.decoder, "keypoints", None)
    lines = [
        f"{model}: a detector of the family {detector.decoder.family}",
        f"input     {width} x {height} {order}, 0 to {255 * style.scale:g}, {fit}",
        f"classes   {len(detector.names)}: {first}{more}",
    ]
    if keypoints is not None:
        lines.append(f"keypoints {keypoints[0]} of each box")
    if trial.scores is None or trial.corners is None:
        lines.append(f"trial     {trial.boxes} boxes a picture, none of which scores")
    else:
        (low, high), (least, most) = trial.scores, trial.corners
        lines.append(
            f"trial     {trial.boxes} boxes a picture before the threshold, scores {low:.2g} to "
            f"{high:.2g}, corners at {least:.0f} to {most:.0f} pixels"
        )
    if trial.invalid:
        lines.append(f"doubt     {trial.invalid} of its outputs were not finite, or of no class")
    lines += [f"doubt     {doubt}" for doubt in trial.doubts]
    if detector.names[0] == "0":
        lines.append("doubt     it names no classes: give them with names=[…], in its order")
    named = "person" if "person" in detector.names else detector.names[0]
    lines.append(f"use       OnnxDetector({model!r}, classes=[{named!r}])")
    return lines
