"""Choice of the reader: what a path holds tells its format."""

from __future__ import annotations

from pathlib import Path

from aerodaas.errors import ConfigError
from tools.evaluation.coco_json import read_coco
from tools.evaluation.dataset import Dataset
from tools.evaluation.yolo_text import read_yolo

__all__ = ["read_dataset"]

_YAML = (".yaml", ".yml")


def read_dataset(path: Path, pictures: Path | None = None) -> Dataset:
    """Read annotations of COCO (a JSON) or YOLO (`data.yaml`, or its folder).

    Args:
        path: File or folder of the annotations.
        pictures: Folder of the pictures, where it is not where the format puts it.

    Raises:
        ConfigError: If it is none of these, is malformed, or has no picture; names the place.
    """
    if path.suffix == ".json":
        dataset = read_coco(path, pictures)
    elif path.suffix in _YAML or _is_yolo(path):
        dataset = read_yolo(path, pictures)
    else:
        raise ConfigError(
            f"{path} holds no annotations that are known: give COCO's .json, or YOLO's data.yaml "
            "or folder (images, labels, classes.txt)"
        )
    if not dataset.pictures:
        raise ConfigError(f"{path} annotates no picture")
    return dataset


def _is_yolo(path: Path) -> bool:
    return (path / "data.yaml").is_file() or (path / "labels").is_dir()
