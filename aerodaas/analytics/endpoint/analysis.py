"""Wrapper that runs an analysis' inference at an endpoint."""

from __future__ import annotations

import logging
import threading
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import Analytics, Context, TimedContext
from aerodaas.analytics.endpoint.connection import Connection
from aerodaas.analytics.endpoint.function import FunctionUrl
from aerodaas.analytics.endpoint.model import EndpointModel
from aerodaas.analytics.endpoint.tensors import TensorSpec
from aerodaas.config.model import ComputeConfig, EndpointConfig
from aerodaas.errors import EndpointError, GraphError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header

__all__ = ["TensorAnalysis", "endpoint_analysis"]

_log = logging.getLogger(__name__)
_PICTURE = (360, 640, 3)


@runtime_checkable
class TensorAnalysis(Protocol):
    """An analysis whose model may run remotely: frames to tensors, and tensors to results."""

    @property
    def model_name(self) -> str:
        """Default name of its model at an endpoint."""
        ...

    @property
    def signature(self) -> tuple[TensorSpec, tuple[TensorSpec, ...]]:
        """The model's input for one frame, and its outputs in order."""
        ...

    def preprocess(self, frames: Sequence[Frame]) -> NDArray[np.floating]:
        """Convert frames of one size to the model's input."""
        ...

    def postprocess(
        self, frames: Sequence[Frame], outputs: Sequence[NDArray[np.floating]]
    ) -> list[Any]:
        """Convert the model's outputs for the frames last preprocessed to results.

        Args:
            frames: The frames.
            outputs: Outputs of the model, each with the batch axis first.

        Returns:
            The result of each frame.
        """
        ...


@runtime_checkable
class _Choosy(Protocol):
    classes: Sequence[str] | None
    min_score: float


def endpoint_analysis(
    work: Analytics[Any], name: str, resource: ComputeConfig, *, strict: bool
) -> Analytics[Any]:
    """Wrap an analysis so that its inference runs at an endpoint.

    Args:
        work: The analysis.
        name: Name of its node.
        resource: Compute resource, with the endpoint.
        strict: Raise EndpointError for a frame without a reply, which is counted and logged in any
            case.

    Raises:
        GraphError: If the endpoint's protocol does not support the analysis.
    """
    endpoint = resource.endpoint
    assert endpoint is not None  # noqa: S101 - implied by the resource's kind
    if endpoint.protocol == "function":
        if not issubclass(work.produces, Detections):
            raise GraphError(
                f"{type(work).__name__} cannot run at {resource.id}: a function's reply is "
                f"detections, not {work.produces.__name__}; deploy it on an edge or cloud node"
            )
        return _FunctionAnalysis(work, name, resource, endpoint, strict=strict)
    if not isinstance(work, TensorAnalysis):
        raise GraphError(
            f"{type(work).__name__} cannot run at {resource.id}: only an analysis with a model of "
            "its own can send it tensors; deploy it on an edge or cloud node"
        )
    return _TensorAnalysis(work, name, resource, endpoint, strict=strict)


class _EndpointAnalysis(Analytics[Any]):
    """Base of the wrappers; subclasses implement the protocol of the endpoint."""

    isolated = True
    scheduled = True
    concurrent = True

    def __init__(
        self,
        work: Any,  # noqa: ANN401 - an analysis that suits the subclass
        name: str,
        resource: ComputeConfig,
        endpoint: EndpointConfig,
        *,
        strict: bool,
    ) -> None:
        self.work = work
        self.name = name
        self.asked = 0
        self._resource = resource
        self._endpoint = endpoint
        self._strict = strict
        self._last = ""
        self._connection: Connection | None = None
        self._lock: Any = None

    def open(self) -> None:
        """Check the endpoint; an unsuitable one is refused, an unreachable one is only logged.

        Raises ConfigError or ModelError.
        """
        self._lock = threading.Lock()
        self._connection = Connection(self._endpoint, self._resource.executors)
        try:
            self._check(self._connection)
        except EndpointError as error:
            self._last = str(error)
            _log.warning("%s: %s; the mission goes on without it", self.name, error)

    def process(self, item: Frame, context: Context) -> Any:  # noqa: ANN401
        """Analyse a frame at the endpoint; None without a reply."""
        budget = context.time_left() if isinstance(context, TimedContext) else None
        with self._lock:
            self.asked += 1
        try:
            result = self._ask(item, budget)
        except EndpointError as error:
            self._fail(error)
            if self._strict:
                raise
            return None
        self._last = ""
        return result

    def close(self) -> None:
        """Log the endpoint's failures, and close the connection."""
        if self._connection is None:
            return
        failures = self._connection.failures
        if failures:
            kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(failures.items()))
            _log.warning("%s: of %d frames sent, attempts failed: %s", self.name, self.asked, kinds)
        self._connection.close()

    def _fail(self, error: EndpointError) -> None:
        """Log a failure once, until a different failure or a success."""
        with self._lock:
            known, self._last = self._last, str(error)
        if known != self._last:
            _log.warning("%s: no answer: %s", self.name, error)

    @abstractmethod
    def _check(self, connection: Connection) -> None:
        """Raise ConfigError or ModelError if unsuitable, EndpointError if unreachable."""

    @abstractmethod
    def _ask(self, frame: Frame, budget: float | None) -> Any:  # noqa: ANN401
        """Analyse a frame; raises EndpointError."""


class _TensorAnalysis(_EndpointAnalysis):
    """Wrapper that uses the Open Inference Protocol."""

    def _check(self, connection: Connection) -> None:
        called = self._endpoint.models.get(self.name) or self.work.model_name
        self._spec, self._outputs = self.work.signature
        self._model = EndpointModel(connection, called)
        self._model.check([self._spec], self._outputs)
        grey = Frame(Header(0, 0, self.name), np.full(_PICTURE, 128, np.uint8))
        self._model.rehearse(self._tensors(grey), self._outputs)

    def _ask(self, frame: Frame, budget: float | None) -> Any:  # noqa: ANN401
        found = self._model.infer(self._tensors(frame), self._outputs, budget)
        return self.work.postprocess([frame], found)[0]

    def _tensors(self, frame: Frame) -> dict[str, NDArray[np.floating]]:
        return {self._spec.name: self.work.preprocess([frame])}


class _FunctionAnalysis(_EndpointAnalysis):
    """Wrapper that sends JPEG to a function's URL and receives JSON."""

    def _check(self, connection: Connection) -> None:
        called = self._endpoint.models.get(self.name, self.name)
        self._function = FunctionUrl(connection, called)
        self._function.check()

    def _ask(self, frame: Frame, budget: float | None) -> Detections:
        if isinstance(self.work, _Choosy):
            return self._function.detect(frame, budget, self.work.classes, self.work.min_score)
        return self._function.detect(frame, budget)
