"""Export of flights as LeRobot datasets (format v3.0), to train policies from.

One episode a flight: what the cameras saw, the vehicle's state, and the velocity that was sent to
it after all limits. https://huggingface.co/docs/lerobot/lerobot-dataset-v3 describes the format.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import RecordingError
from aerodaas.extensions.exports.video import VideoFile
from aerodaas.messages.vehicle import Setpoint, VehicleState, VelocitySetpoint
from aerodaas.recording.new_file import file_name, new_file
from aerodaas.recording.pictures import frames, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.reference_frames import from_rpy

__all__ = ["ACTION", "STATE", "write_lerobot"]

_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
STATE = (
    *("position.east", "position.north", "position.up"),
    *("velocity.east", "velocity.north", "velocity.up"),
    *("attitude.x", "attitude.y", "attitude.z", "attitude.w"),
)
"""Metres and metres per second, local ENU; attitude of the body (FLU) in ENU as a quaternion."""
ACTION = ("velocity.east", "velocity.north", "velocity.up", "yaw_rate")
"""Metres per second, local ENU; radians per second, counter-clockwise."""

_CHUNK = "chunk-000/file-000"
_MOST_FRAMES = 1_000_000
_FASTEST = 240
"""Frames per second."""
_STALE = NANOSECONDS
"""After which a setpoint is no longer in force; a flight sends twenty each second."""
_SAMPLES = 100
"""Pictures from which the statistics of a camera's pixels are made, at most."""
_SAMPLE_WIDTH = 160
"""Pixels to which they are scaled before."""
_ROUNDING = 1000
"""Nanoseconds by which the stamp of what belongs to a row may be rounded up."""

_Floats = NDArray[np.float32]
_Stamps = NDArray[np.int64]


def _write_tables(path: Path, task: str, episode: _Episode) -> None:
    """Write all but the videos into the dataset's folder."""
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        raise RecordingError(
            'a LeRobot dataset needs pyarrow: pip install "aerodaas[parquet]"'
        ) from None
    columns, features, fps = episode.columns(), episode.features(), episode.fps
    videos = list(episode.cameras)
    count = len(columns["index"])
    stats = {name: _statistics(values, video=name in videos) for name, values in columns.items()}
    for name in videos:
        stats[name]["count"] = [count]

    def save(table: Any, name: str) -> None:  # noqa: ANN401 - pyarrow's
        file = path / name.format(chunk_index=0, file_index=0)
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
    described: dict[str, list[Any]] = {
        "episode_index": [0],
        "tasks": [[task]],
        "length": [count],
        "dataset_from_index": [0],
        "dataset_to_index": [count],
    }
    for name in ("data", "meta/episodes", *(f"videos/{video}" for video in videos)):
        described |= {f"{name}/chunk_index": [0], f"{name}/file_index": [0]}
    for video in videos:
        described |= {
            f"videos/{video}/from_timestamp": [0.0],
            f"videos/{video}/to_timestamp": [count / fps],
        }
    for name, found in stats.items():
        described |= {f"stats/{name}/{figure}": [value] for figure, value in found.items()}
    save(pa.table(described), f"meta/episodes/{_FILE}.parquet")
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


def write_lerobot(recording: Recording, folder: Path, *, task: str) -> list[Path]:
    """Write a LeRobot dataset of one episode for each robot with a camera.

    Rows come at the cameras' rate (the median of the fastest one's, in whole frames per second).
    A picture belongs to the row whose time is nearest to its own. Each row has the newest picture
    of each camera, the newest state up to then, and the velocity setpoint in force: as sent, after
    all limits, zero where none was sent for a second. Where a place was sent instead, it is the
    velocity straight there, at the speed asked for or else flown.

    Args:
        recording: An open recording.
        folder: Folder of the datasets, which are folders themselves.
        task: What the robot was to do, as LeRobot's policies are told.

    Returns:
        The datasets.

    Raises:
        RecordingError: If no robot has pictures and states, pyarrow is missing, or a dataset
            exists or cannot be written.
    """
    if not task.strip():
        raise RecordingError(
            "a LeRobot dataset needs its task in words, such as 'survey the field'"
        )
    robots = _robots(recording)
    episodes = [
        (robot, cameras, episode)
        for robot, cameras in sorted(robots.items())
        if (episode := _episode(recording, robot, cameras)) is not None
    ]
    if not episodes:
        raise RecordingError(
            f"{recording.path} has no robot with states and two pictures or more; were they off?"
        )
    stem = f"{recording.path.stem}_lerobot"
    written = []
    for robot, cameras, episode in episodes:
        name = stem if len(episodes) == 1 else f"{stem}_{file_name(robot)}"
        path = new_file(folder / name)
        try:
            for camera in _filmed(recording, path, cameras, episode):
                episode.cameras[camera.key] = camera
            _write_tables(path, task, episode)
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror}") from None
        written.append(path)
    return written


@dataclass
class _Camera:
    """A camera's video, and what its pixels are like."""

    key: str
    video: VideoFile
    last: NDArray[np.uint8]
    """The newest picture."""
    start: int
    """Mission nanoseconds at which its video begins."""
    fps: int
    rows: int
    frames: int = 0
    """Written so far."""
    samples: list[_Floats] = field(default_factory=list)

    def fill(self, until: int) -> None:
        """Show the newest picture in all rows before this one that show none yet."""
        while self.frames < until:
            self._add(self.last)

    def _add(self, image: NDArray[np.uint8]) -> None:
        width, height = self.video.size
        if image.shape[0] < height or image.shape[1] < width:
            # A camera that has become smaller; a video has one size.
            image = np.asarray(cv2.resize(image, (width, height)), np.uint8)
        self.video.add(image, self.start + _times(self.frames, self.fps))
        if self.frames % -(-self.rows // _SAMPLES) == 0:
            small = (_SAMPLE_WIDTH, max(1, round(height * _SAMPLE_WIDTH / width)))
            pixels = cv2.resize(image, small, interpolation=cv2.INTER_AREA)
            rows = pixels[..., ::-1].reshape(-1, 3)
            self.samples.append(np.divide(rows, 255, dtype=np.float32))
        self.frames += 1


@dataclass
class _Episode:
    """Rows of an episode, and its cameras once they are written."""

    fps: int
    stamps: _Stamps
    """Mission nanoseconds of the rows."""
    state: _Floats
    """N x 10."""
    action: _Floats
    """N x 4."""
    cameras: dict[str, _Camera] = field(default_factory=dict)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Columns for statistics, by feature: N x values; of cameras, samples of the pixels."""
        count = len(self.stamps)
        index = np.arange(count, dtype=np.int64)[:, None]
        zero = np.zeros((count, 1), np.int64)
        return {
            "observation.state": self.state,
            "action": self.action,
            "timestamp": (index / self.fps).astype(np.float32),
            "frame_index": index,
            "episode_index": zero,
            "index": index,
            "task_index": zero,
            **{key: np.concatenate(one.samples) for key, one in self.cameras.items()},
        }

    def features(self) -> dict[str, dict[str, Any]]:
        """Features as `info.json` describes them."""
        numbers = ("frame_index", "episode_index", "index", "task_index")
        found: dict[str, dict[str, Any]] = {
            "observation.state": _feature("float32", STATE),
            "action": _feature("float32", ACTION),
            "timestamp": _feature("float32"),
            **{name: _feature("int64") for name in numbers},
        }
        for key, camera in self.cameras.items():
            width, height = camera.video.size
            found[key] = {
                "dtype": "video",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
                "info": {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": "h264",
                    "video.pix_fmt": "yuv420p",
                    "video.is_depth_map": False,
                    "video.fps": self.fps,
                    "video.channels": 3,
                    "has_audio": False,
                },
            }
        return found


_Count = TypeVar("_Count", int, NDArray[np.int64])


def _times(rows: _Count, fps: int) -> _Count:
    """Nanoseconds from the first row to each of `rows`, rounded to the nearest."""
    return (rows * NANOSECONDS + fps // 2) // fps


def _row(nanoseconds: int, fps: int) -> int:
    """The row whose time is nearest to `nanoseconds` from the first."""
    return (nanoseconds * fps + NANOSECONDS // 2) // NANOSECONDS


def _feature(dtype: str, names: Sequence[str] = ()) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [len(names) or 1], "names": list(names) or None}


def _robots(recording: Recording) -> dict[str, dict[str, list[int]]]:
    """Capture times of each robot's cameras, ascending; of none that has a single picture."""
    found: dict[str, dict[str, set[int]]] = defaultdict(lambda: defaultdict(set))
    for shot in shots(recording):
        robot, slash, _ = shot.header.source.partition("/")
        if slash:
            found[robot][shot.header.source].add(shot.header.stamp)
    several = {
        robot: {source: sorted(stamps) for source, stamps in cameras.items() if len(stamps) > 1}
        for robot, cameras in found.items()
    }
    return {robot: cameras for robot, cameras in several.items() if cameras}


def _episode(recording: Recording, robot: str, cameras: dict[str, list[int]]) -> _Episode | None:
    states: dict[int, list[float]] = {}
    for record in recording.records(schemas=("aerodaas.VehicleState",)):
        if record.labels.robot == robot:
            state: VehicleState = record.value
            pose = state.odometry
            turned = from_rpy(pose.roll, pose.pitch, pose.yaw)
            values = [*pose.position, *pose.velocity, *turned]
            if all(map(math.isfinite, values)):
                states[state.stamp] = values
    if not states:
        return None
    times = np.array(sorted(states), np.int64)
    gap = min(float(np.median(np.diff(stamps))) for stamps in cameras.values())
    fps = min(max(round(NANOSECONDS / gap), 1), _FASTEST)
    begin = max(int(times[0]), *(stamps[0] for stamps in cameras.values()))
    end = min(int(times[-1]), *(stamps[-1] for stamps in cameras.values()))
    count = _row(end - begin, fps) + 1
    if count <= 1:
        return None
    if count > _MOST_FRAMES:
        raise RecordingError(f"{robot} has {count} frames, more than {_MOST_FRAMES}")
    stamps = begin + _times(np.arange(count, dtype=np.int64), fps)
    newest = times[np.searchsorted(times, stamps + _ROUNDING, side="right") - 1]
    rows = np.array([states[int(at)] for at in newest], np.float32)
    return _Episode(fps, stamps, rows, _actions(recording, robot, stamps, rows))


def _actions(recording: Recording, robot: str, stamps: _Stamps, states: _Floats) -> _Floats:
    """Setpoints in force at each row, N x 4."""
    sent: dict[int, Setpoint | None] = {}
    for record in recording.records(schemas=("aerodaas.Setpoint",)):
        if record.labels.robot == robot:
            sent[record.value.stamp] = record.value.sent
    actions = np.zeros((len(stamps), len(ACTION)), np.float32)
    times = np.array(sorted(sent), np.int64)
    if not len(times):
        return actions
    for row, place in enumerate(np.searchsorted(times, stamps + _ROUNDING, side="right") - 1):
        if place >= 0 and stamps[row] - times[place] < _STALE:
            setpoint = sent[int(times[place])]
            actions[row] = np.nan_to_num(_action(setpoint, states[row, :3], states[row, 3:6]))
    return actions


def _action(setpoint: Setpoint | None, position: _Floats, velocity: _Floats) -> list[float]:
    if setpoint is None:
        return [0.0] * len(ACTION)
    if isinstance(setpoint, VelocitySetpoint):
        return [*setpoint.velocity, setpoint.yaw_rate]
    way = setpoint.position - position
    distance = float(np.linalg.norm(way))
    asked = setpoint.speed
    speed = float(np.linalg.norm(velocity)) if asked is None else asked
    return [*(way / max(distance, 1e-9) * min(speed, distance)).tolist(), 0.0]


def _filmed(
    recording: Recording, path: Path, cameras: dict[str, list[int]], episode: _Episode
) -> list[_Camera]:
    """Write the cameras' videos: for each row the newest picture up to then that can be decoded."""
    rows = len(episode.stamps)
    made: dict[str, _Camera] = {}
    try:
        for frame in frames(recording):
            source = frame.header.source
            if source not in cameras:
                continue
            if source not in made:
                key = f"observation.images.{file_name(source.partition('/')[2]) or 'camera'}"
                file = new_file(path / "videos" / key / f"{_CHUNK}.mp4")
                made[source] = _Camera(
                    key, VideoFile(file, frame), frame.image, frame.header.stamp, episode.fps, rows
                )
            first = _row(frame.header.stamp - int(episode.stamps[0]), episode.fps)
            made[source].fill(min(first, rows))
            made[source].last = frame.image
        if len(made) < len(cameras):
            raise RecordingError(f"{recording.path}: no picture of a camera can be decoded")
        for camera in made.values():
            camera.fill(rows)
            camera.video.finish()
    finally:
        for camera in made.values():
            camera.video.close()
    return list(made.values())
