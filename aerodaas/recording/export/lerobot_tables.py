"""Tables of a LeRobot dataset (format v3.0) of one episode: rows, episodes, tasks, statistics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.errors import RecordingError

__all__ = ["write_tables"]

_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


def write_tables(
    path: Path,
    task: str,
    columns: dict[str, NDArray[Any]],
    features: dict[str, dict[str, Any]],
    fps: int,
) -> None:
    """Write all but the videos.

    Args:
        path: Folder of the dataset.
        task: In words.
        columns: N x values of each feature; of videos, samples of pixels, 0 to 1, N x 3 of RGB.
        features: As `info.json` describes them.
        fps: Rows a second.

    Raises:
        RecordingError: If pyarrow is missing.
        OSError: If something cannot be written.
    """
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        raise RecordingError(
            'a LeRobot dataset needs pyarrow: pip install "aerodaas[parquet]"'
        ) from None
    videos = [name for name, feature in features.items() if feature["dtype"] == "video"]
    count = len(columns["index"])
    stats = {name: _statistics(values, video=name in videos) for name, values in columns.items()}
    for name in videos:
        stats[name]["count"] = [count]

    def save(table: Any, name: str, number: int = 0) -> None:  # noqa: ANN401 - pyarrow's
        file = path / name.format(chunk_index=0, file_index=number)
        file.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(table, file)

    rows = {}
    for name, values in columns.items():
        if name in videos:
            continue
        kind = pa.from_numpy_dtype(values.dtype)
        width = values.shape[1]
        flat = pa.array(values.reshape(-1), kind)
        rows[name] = flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)
    save(pa.table(rows), f"data/{_FILE}.parquet")
    episode: dict[str, list[Any]] = {
        "episode_index": [0],
        "tasks": [[task]],
        "length": [count],
        "dataset_from_index": [0],
        "dataset_to_index": [count],
    }
    for name in ("data", "meta/episodes", *(f"videos/{video}" for video in videos)):
        episode |= {f"{name}/chunk_index": [0], f"{name}/file_index": [0]}
    for video in videos:
        episode |= {
            f"videos/{video}/from_timestamp": [0.0],
            f"videos/{video}/to_timestamp": [count / fps],
        }
    for name, found in stats.items():
        episode |= {f"stats/{name}/{figure}": [value] for figure, value in found.items()}
    save(pa.table(episode), f"meta/episodes/{_FILE}.parquet")
    save(_tasks(pa, task), "meta/tasks.parquet")
    info = {
        "codebase_version": "v3.0",
        "robot_type": "drone",
        "total_episodes": 1,
        "total_frames": count,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": "0:1"},
        "data_path": f"data/{_FILE}.parquet",
        "video_path": f"videos/{{video_key}}/{_FILE}.mp4",
        "features": features,
    }
    for name, content in (("info", info), ("stats", stats)):
        text = json.dumps(content, indent=4, allow_nan=False) + "\n"
        (path / "meta" / f"{name}.json").write_text(text, encoding="utf-8")


def _statistics(values: NDArray[Any], *, video: bool) -> dict[str, list[Any]]:
    """Minimum, maximum, mean and so on of each value; of pixels, a channel is 1 x 1."""
    data = values.astype(np.float64)
    figures = {
        "min": data.min(axis=0),
        "max": data.max(axis=0),
        "mean": data.mean(axis=0),
        "std": data.std(axis=0),
        **{name: np.quantile(data, share, axis=0) for name, share in _QUANTILES.items()},
    }
    shape = (3, 1, 1) if video else (-1,)
    found: dict[str, list[Any]] = {
        name: array.reshape(shape).tolist() for name, array in figures.items()
    }
    return {**found, "count": [len(data)]}


def _tasks(pa: Any, task: str) -> Any:  # noqa: ANN401 - pyarrow and its table
    """The table of tasks, which pandas reads with the task as its index, as LeRobot expects."""

    def column(name: str, kind: str, stored: str) -> dict[str, Any]:
        return {
            "name": name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": stored,
            "metadata": None,
        }

    described = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": [task]})
    return table.replace_schema_metadata({"pandas": json.dumps(described)})
