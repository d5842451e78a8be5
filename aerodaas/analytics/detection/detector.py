"""OnnxDetector: labelled boxes (and keypoints) in frames, by any model of a supported family."""

from __future__ import annotations

import copy
import logging
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray
from typing_extensions import Self

from aerodaas.analytics.base import Analytics, Context, ResourceUse
from aerodaas.analytics.detection.families import FAMILIES
from aerodaas.analytics.detection.families.base import Candidates, ModelFamily
from aerodaas.analytics.detection.letterbox import Letterbox
from aerodaas.analytics.detection.model_file import read_model
from aerodaas.analytics.detection.providers import open_session
from aerodaas.analytics.detection.recognition import class_names, recognise
from aerodaas.analytics.detection.suppression import strongest, suppress
from aerodaas.analytics.detection.trial import Trial, preprocessing_for, try_out
from aerodaas.analytics.endpoint.tensors import TensorSpec
from aerodaas.analytics.models import DETECTOR
from aerodaas.config.checked import PositiveFraction
from aerodaas.errors import ModelError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame

__all__ = ["OnnxDetector"]

_log = logging.getLogger(__name__)
_MOST_CANDIDATES = 1000
_MOST_DETECTIONS = 300
_WARM_UP_RUNS = 2
_USUAL_FRAMES = ((720, 1280), (720, 960))
"""Height and width of frames for which a network of variable size is warmed up: 16:9 and 4:3."""


class _Buffers(threading.local):
    """Working buffers of one thread, which are not pickled."""

    letterbox: Letterbox | None = None
    buffer: NDArray[Any] | None = None

    def __reduce__(self) -> tuple[type[_Buffers], tuple[()]]:
        return _Buffers, ()


class OnnxDetector(Analytics[Detections]):
    """Detects objects, with their keypoints if the model is a pose model.

    ``OnnxDetector("yolox-nano", classes=["person"])``, or a file of one's own. The model's family,
    class names and input size are read from the file, which is copied to where it runs: an edge
    or cloud node needs no copy.
    """

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections
    isolated = True
    scheduled = True
    concurrent = True
    resources: ClassVar[Mapping[str, ResourceUse]] = {"path": "model"}

    def __init__(
        self,
        path: str | Path = DETECTOR,
        *,
        classes: Sequence[str] | None = None,
        min_score: PositiveFraction = 0.3,
        iou: PositiveFraction = 0.6,
        names: Sequence[str] | None = None,
        size: int | None = None,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
        families: Sequence[ModelFamily] = FAMILIES,
    ) -> None:
        """Read the model and check that it is a detector.

        Args:
            path: ONNX file, or the name of a fetched model (`aerodaas models list`); by default
                the shipped one.
            classes: Class names to keep; by default all.
            min_score: Least confidence of a detection, above 0 to 1.
            iou: Overlap of two boxes of one class above which only the better one is kept,
                above 0 to 1.
            names: Class names that replace the file's.
            size: Side of the input in pixels, a multiple of 32, for models of variable size.
            providers: Execution providers in onnxruntime's spelling, best first; by default the
                best available one.
            threads: Threads of onnxruntime, 1 or more; by default half of the cores.
            families: Model families to recognise, in order.

        Raises:
            ModelError: If the file or a setting is unsuitable, the model of this name was not
                fetched, or a trial run shows that it cannot be a detector.
            UnknownIdError: If no model has this name.
        """
        for name, value in (("min_score", min_score), ("iou", iou)):
            if not 0.0 < value <= 1.0:
                message = f"{name} must lie above 0 and not above 1, not {value}"
                raise ModelError(message)
        if threads is not None and threads < 1:
            message = f"threads must be 1 or more, not {threads}"
            raise ModelError(message)
        model = read_model(path, size)
        self.path = str(path)
        self.classes = classes
        self.min_score = min_score
        self.iou = iou
        self.providers = providers
        self.threads = threads
        self.decoder = recognise(model, families)
        self.names = class_names(model, self.decoder, names)
        self.size = model.size
        self.invalid = 0
        """Number of outputs dropped so far because they were not finite."""
        self.excess = 0
        """Number of boxes dropped so far because a frame had implausibly many."""
        self._wanted = _wanted_classes(self.path, self.names, classes)
        self.style = preprocessing_for(model, self.decoder)
        """How frames become the network's input."""
        self._content = model.content
        self._input = model.input.name
        self._dtype = model.dtype
        self._batches = model.batches
        self._flexible = model.resizes
        self._session: ort.InferenceSession | None = None
        self._outputs = tuple(
            TensorSpec.of(output.name, np.float32, output.shape) for output in model.outputs
        )
        self._buffers = _Buffers()
        self.trial: Trial = try_out(model, self.decoder, self.style)
        """What the model gave for the trial pictures."""

    def with_model(self, path: str | Path) -> Self:
        """Return a detector with the model at `path` and the same classes, thresholds and threads.

        Raises:
            ModelError: If the file or a setting is unsuitable.
        """
        twin = copy.copy(self)
        OnnxDetector.__init__(
            twin,
            path,
            classes=self.classes,
            min_score=self.min_score,
            iou=self.iou,
            providers=self.providers,
            threads=self.threads,
        )
        return twin

    def open(self) -> None:
        """Create the session and warm it up, so that the mission's first frame is not slow.

        On a GPU what is made for one size of input is made again for another.
        """
        self._session = open_session(self._content, self.path, self.providers, self.threads)
        for frame in _USUAL_FRAMES:
            letterbox = Letterbox(frame, self.size, self.style, flexible=self._flexible)
            blank = letterbox.buffer(1, self._dtype)
            for _ in range(_WARM_UP_RUNS):
                self.infer(blank)

    def close(self) -> None:
        """Release the session, and log the numbers of dropped outputs and boxes."""
        if self.invalid or self.excess:
            _log.warning(
                "%s: dropped %d outputs that were not finite and %d boxes too many",
                self.path,
                self.invalid,
                self.excess,
            )
        self._session = None

    def process(self, item: Frame, context: Context) -> Detections:
        """Detect the objects in one frame."""
        del context
        return self.detect([item])[0]

    def detect(self, frames: Sequence[Frame]) -> list[Detections]:
        """Detect the objects in each frame, as one batch if sizes and model allow it."""
        same_size = len({frame.image.shape for frame in frames}) == 1
        if len(frames) > 1 and not (self._batches and same_size):
            return [self.detect([frame])[0] for frame in frames]
        if not frames or frames[0].image.size == 0:
            return [Detections.of(frame, ()) for frame in frames]
        return self.postprocess(frames, self.infer(self.preprocess(frames)))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the classes that it keeps, in the model's order."""
        if self._wanted is None:
            return self.names
        return tuple(self.names[number] for number in self._wanted)

    @property
    def model_name(self) -> str:
        """Default name of the model at an endpoint: its file name without suffix."""
        return Path(self.path).stem

    @property
    def signature(self) -> tuple[TensorSpec, tuple[TensorSpec, ...]]:
        """The network's input for one frame, and its outputs."""
        axes = (None, None) if self._flexible else self.size
        spec = TensorSpec.of(self._input, self._dtype, (1, 3, *axes))
        return spec, self._outputs

    def preprocess(self, frames: Sequence[Frame]) -> NDArray[Any]:
        """Letterbox frames of one size into the network's input, count x 3 x height x width.

        The returned array is overwritten by this thread's next call.
        """
        buffers = self._buffers
        shape = (frames[0].height, frames[0].width)
        if buffers.letterbox is None or buffers.letterbox.frame != shape:
            buffers.letterbox = Letterbox(shape, self.size, self.style, flexible=self._flexible)
            buffers.buffer = None
        if buffers.buffer is None or len(buffers.buffer) != len(frames):
            buffers.buffer = buffers.letterbox.buffer(len(frames), self._dtype)
        for frame, slot in zip(frames, buffers.buffer, strict=True):
            buffers.letterbox.write(frame.image, slot)
        return buffers.buffer

    def infer(self, pixels: NDArray[Any]) -> list[NDArray[Any]]:
        """Run the network.

        Raises:
            ModelError: If called before `open`.
        """
        if self._session is None:
            message = f"{self.path}: call open() before the first frame"
            raise ModelError(message)
        return [np.asarray(output) for output in self._session.run(None, {self._input: pixels})]

    def postprocess(
        self, frames: Sequence[Frame], outputs: Sequence[NDArray[Any]]
    ) -> list[Detections]:
        """Convert the network's outputs for the frames last preprocessed to detections.

        Args:
            frames: The frames, of one size.
            outputs: Outputs of the network, each with the batch axis first.

        Returns:
            The detections of each frame.

        Raises:
            ModelError: If no frames were preprocessed.
        """
        letterbox = self._buffers.letterbox
        if letterbox is None:
            message = f"{self.path}: preprocess the frames first"
            raise ModelError(message)
        return [
            self._gather(frame, letterbox, [np.asarray(o[index], np.float32) for o in outputs])
            for index, frame in enumerate(frames)
        ]

    def _gather(
        self, frame: Frame, letterbox: Letterbox, outputs: Sequence[NDArray[np.float32]]
    ) -> Detections:
        found = self.decoder.decode(outputs, letterbox.network, self.min_score)
        self._count_invalid(found.invalid)
        if self._wanted is not None:
            found = found.select(np.isin(found.classes, self._wanted))
        everything = len(found)
        found = strongest(found, _MOST_CANDIDATES)
        self.excess += everything - len(found)
        if self.decoder.overlapping:
            found = suppress(found, self.iou)
        bounded = strongest(found, _MOST_DETECTIONS)
        self.excess += len(found) - len(bounded)
        return Detections.of(frame, self._detections(bounded, letterbox))

    def _detections(self, found: Candidates, letterbox: Letterbox) -> list[Detection]:
        boxes = letterbox.restore(found.boxes.reshape(-1, 2, 2)).reshape(-1, 4)
        points = found.keypoints
        if points is not None:
            points = np.concatenate([letterbox.restore(points[..., :2]), points[..., 2:]], axis=2)
        # Clipping leaves nothing of a box outside the image.
        inside = np.flatnonzero((boxes[:, 2:] > boxes[:, :2]).all(axis=1))
        rows = zip(inside, boxes[inside].tolist(), strict=True)
        return [
            Detection(
                (left, top, right, bottom),
                self.names[int(found.classes[index])],
                min(1.0, float(found.scores[index])),
                keypoints=None if points is None else points[index],
            )
            for index, (left, top, right, bottom) in rows
        ]

    def _count_invalid(self, count: int) -> None:
        if count and not self.invalid:
            _log.warning("%s: gives outputs that are not finite; they are dropped", self.path)
        self.invalid += count


def _wanted_classes(
    path: str, names: Sequence[str], classes: Sequence[str] | None
) -> list[int] | None:
    if classes is None:
        return None
    chosen = [classes] if isinstance(classes, str) else list(classes)
    unknown = [label for label in chosen if label not in names]
    if unknown or not chosen:
        message = (
            f"the model {path} knows no class {', '.join(unknown) or '(none asked for)'}; "
            f"it knows {', '.join(names)}"
        )
        raise ModelError(message)
    return [number for number, label in enumerate(names) if label in chosen]
