"""Time of each step of detection, beside the plain onnxruntime call.

python benchmarks/vision.py ../shared/data/models/*.onnx --frames ../shared/data/frames
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import onnxruntime as ort
import typer
from _report import Report

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.detection.providers import default_threads
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.frames import Frame, Header

UNITS = {
    "pre": "ms",
    "infer": "ms",
    "post": "ms",
    "pre+post": "% infer",
    "total": "ms",
    "p99": "ms",
    "bare ort": "ms",
    "boxes": "a frame",
}


def main(
    models: Annotated[list[Path], typer.Argument(help="ONNX detectors to time.")],
    frames: Annotated[
        Path | None, typer.Option(help="Folder of pictures; noise of 1280 x 720 without it.")
    ] = None,
    rounds: Annotated[int, typer.Option(help="Frames timed per model.", min=1)] = 100,
    threads: Annotated[
        int | None, typer.Option(help="onnxruntime's threads; half of the cores by default.", min=1)
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Time pre-processing, inference and post-processing of each model, frame by frame.

    Medians over the frames. "bare ort" is the plain onnxruntime call: the same file on an input
    that is ready, with as many threads, decoding nothing.
    """
    pictures = _pictures(frames)
    report = Report("vision", UNITS, packages=["onnxruntime", "opencv-python-headless"])
    threads = threads or default_threads()
    report.note(f"{threads} thread(s), {rounds} of {len(pictures)} different frames per model.")
    try:
        for path in models:
            report.row(path.name, _time(path, pictures, rounds, threads))
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    report.show()
    if json is not None:
        report.write(json)


def _time(path: Path, pictures: list[Frame], rounds: int, threads: int) -> dict[str, float]:
    detector = OnnxDetector(path, threads=threads)
    detector.open()
    plain = _plain_call(path, detector, threads)
    steps: list[tuple[float, float, float]] = []
    alone: list[float] = []
    boxes = 0
    for index in range(rounds):
        frame = pictures[index % len(pictures)]
        start = time.perf_counter()
        pixels = detector.preprocess([frame])
        ready = time.perf_counter()
        outputs = detector.infer(pixels)
        inferred = time.perf_counter()
        (found,) = detector.postprocess([frame], outputs)
        steps.append((ready - start, inferred - ready, time.perf_counter() - inferred))
        boxes += len(found)
        # In turn with ours, so that both meet the same state of the machine.
        start = time.perf_counter()
        plain(pixels)
        alone.append(time.perf_counter() - start)
    pre, inference, post = (1000 * statistics.median(column) for column in zip(*steps, strict=True))
    totals = [1000 * sum(step) for step in steps]
    return {
        "pre": pre,
        "infer": inference,
        "post": post,
        "pre+post": 100 * (pre + post) / inference,
        "total": statistics.median(totals),
        "p99": float(np.percentile(totals, 99)),
        "bare ort": 1000 * statistics.median(alone),
        "boxes": boxes / rounds,
    }


def _plain_call(
    path: Path, detector: OnnxDetector, threads: int
) -> Callable[[np.ndarray[tuple[int, ...], np.dtype[np.floating]]], object]:
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    session = ort.InferenceSession(str(path), options, providers=ort.get_available_providers())
    name = session.get_inputs()[0].name
    session.run(None, {name: np.zeros((1, 3, *detector.size), np.float32)})
    return lambda pixels: session.run(None, {name: pixels})


def _pictures(folder: Path | None) -> list[Frame]:
    if folder is None:
        noise = np.random.default_rng(0).integers(0, 256, (720, 1280, 3), np.uint8)
        return [Frame(Header(0, 0, "noise"), noise)]
    images = [cv2.imread(str(path)) for path in sorted(folder.iterdir())]
    frames = [
        Frame(Header(index, 0, "folder"), np.asarray(image, np.uint8))
        for index, image in enumerate(images)
        if image is not None
    ]
    if not frames:
        typer.echo(f"{folder} holds no pictures", err=True)
        raise typer.Exit(2)
    return frames


if __name__ == "__main__":
    typer.run(main)
