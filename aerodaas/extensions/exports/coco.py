"""Export of pictures and detections as a COCO dataset, to label further and to train from.

The format is that of `instances_*.json` by https://cocodataset.org/#format-data: boxes are left,
top, width and height in pixels of the picture.
"""

from __future__ import annotations

import json
import logging
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.errors import RecordingError
from aerodaas.messages.detections import Detection
from aerodaas.recording.decoding.limits import MAX_KEYS
from aerodaas.recording.new_file import file_name, new_file
from aerodaas.recording.pictures import RecordedImage, detections_by_frame, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.overlay import VISIBLE

__all__ = ["write_coco"]

_log = logging.getLogger(__name__)
_SEEN = 2
"""COCO's flag of a keypoint that is seen; 0 is one that is not labelled."""


def write_coco(recording: Recording, folder: Path, *, interval: float = 1.0) -> Path:
    """Write pictures and their detections as a COCO dataset.

    Pictures that are files in the recording stay as they are; others become JPEG. What a detector
    found is the annotation: a beginning for people who label, no truth. `score` and `track_id` are
    kept beside COCO's own fields.

    Args:
        recording: An open recording.
        folder: Folder of the dataset, which is a folder itself: `images` and `annotations.json`.
        interval: Least seconds between two pictures of a camera; 0 for all.

    Returns:
        The dataset.

    Raises:
        RecordingError: If there are no pictures or more than `MAX_KEYS` labels, or the dataset
            exists or cannot be written.
    """
    path = new_file(folder / f"{recording.path.stem}_coco")
    found = detections_by_frame(recording)
    labels = sorted({item.label for items in found.values() for item in items})
    if len(labels) > MAX_KEYS:
        raise RecordingError(f"{recording.path} has {len(labels)} labels, more than {MAX_KEYS}")
    points = _points(found)
    numbers = {label: number for number, label in enumerate(labels, 1)}
    names: Counter[str] = Counter()
    left_out = 0
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    try:
        for shot in _spaced(shots(recording), round(interval * NANOSECONDS)):
            picture = shot.file()
            if picture is None:
                continue
            width, height = picture.width, picture.height
            suffix = "jpg" if picture.format == "jpeg" else picture.format
            source, stamp = shot.header.source, shot.header.stamp
            stem = f"{file_name(source) or 'camera'}-{shot.header.id:06}"
            # A camera that was started anew counts its frames anew.
            again = names[stem]
            names[stem] += 1
            name = f"{stem}{f'-{again + 1}' if again else ''}.{suffix}"
            target = new_file(path / "images" / name)
            target.write_bytes(picture.data)
            images.append(
                {
                    "id": len(images) + 1,
                    "file_name": name,
                    "width": width,
                    "height": height,
                    "camera": source,
                    "mission_seconds": seconds(stamp),
                }
            )
            for item in found.get((source, stamp), ()):
                annotation = _annotation(item, width, height, points.get(item.label, 0))
                if annotation is None:
                    left_out += 1
                    continue
                annotation["id"] = len(annotations) + 1
                annotation["image_id"] = len(images)
                annotation["category_id"] = numbers[item.label]
                annotations.append(annotation)
        if left_out:
            _log.warning("%s: left out %d boxes outside their pictures", path, left_out)
        if not images:
            raise RecordingError(f"{recording.path} holds no pictures; were they switched off?")
        content = {
            "info": {"description": f"{recording.path.name}, detected, not verified"},
            "images": images,
            "annotations": annotations,
            "categories": [_category(label, numbers[label], points) for label in labels],
        }
        (path / "annotations.json").write_text(json.dumps(content) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from None
    return path


def _spaced(found: Iterator[RecordedImage], gap: int) -> Iterator[RecordedImage]:
    """Pictures of each camera at least `gap` nanoseconds apart."""
    newest: dict[str, int] = {}
    for shot in found:
        source, stamp = shot.record.topic, shot.header.stamp
        if source not in newest or stamp >= newest[source] + gap:
            newest[source] = stamp
            yield shot


def _points(found: dict[tuple[str, int], list[Detection]]) -> dict[str, int]:
    """Keypoints by label; labels whose detections differ in their number have none."""
    counts: dict[str, set[int]] = {}
    for items in found.values():
        for item in items:
            number = 0 if item.keypoints is None else len(item.keypoints)
            counts.setdefault(item.label, set()).add(number)
    return {label: number for label, (number, *more) in counts.items() if number and not more}


def _category(label: str, number: int, points: dict[str, int]) -> dict[str, Any]:
    category: dict[str, Any] = {"id": number, "name": label}
    if label in points:
        category["keypoints"] = [str(index) for index in range(points[label])]
        category["skeleton"] = []
    return category


def _annotation(item: Detection, width: int, height: int, points: int) -> dict[str, Any] | None:
    """COCO's annotation of a detection; None where no pixel of the picture lies in its box."""
    left, right = (min(max(edge, 0.0), width) for edge in item.box[::2])
    top, bottom = (min(max(edge, 0.0), height) for edge in item.box[1::2])
    across, down = right - left, bottom - top
    if across <= 0.0 or down <= 0.0:
        return None
    annotation: dict[str, Any] = {
        "bbox": [left, top, across, down],
        "area": across * down,
        "iscrowd": 0,
        "segmentation": [],
        "score": item.score,
    }
    if item.track_id is not None:
        annotation["track_id"] = item.track_id
    if points and item.keypoints is not None:
        seen = [
            (float(u), float(v), _SEEN) if c >= VISIBLE and math.isfinite(u + v) else (0.0, 0.0, 0)
            for u, v, c in item.keypoints.tolist()
        ]
        annotation["keypoints"] = [figure for point in seen for figure in point]
        annotation["num_keypoints"] = sum(flag > 0 for _, _, flag in seen)
    return annotation
