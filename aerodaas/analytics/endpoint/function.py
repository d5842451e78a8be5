"""Client of a plain function's URL: JPEG image in the request, detections as JSON in the reply.

Request: `POST url`, `Content-Type: image/jpeg`, `X-Analysis: <name>`. Reply, status 200::

    {"detections": [{"box": [left, top, right, bottom], "label": "person", "score": 0.9}]}

Boxes are in pixels of the sent image; `track_id` (integer) and `keypoints` (a list of
`[u, v, confidence]`) may be added.
"""

from __future__ import annotations

from collections.abc import Sequence
from http import HTTPStatus
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.analytics.endpoint.connection import Connection, Reply
from aerodaas.analytics.endpoint.model import refuse_denied
from aerodaas.errors import ConfigError, EndpointError
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame

__all__ = ["FunctionUrl"]

_QUALITY = 90
_MOST_DETECTIONS = 300
_GREY = np.full((360, 640, 3), 128, np.uint8)
_GONE = {HTTPStatus.NOT_FOUND, HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.UNSUPPORTED_MEDIA_TYPE}
Number = Annotated[float, Field(allow_inf_nan=False)]


class _Found(BaseModel):
    """One object in the function's reply."""

    model_config = ConfigDict(extra="ignore")

    box: tuple[Number, Number, Number, Number]
    label: Annotated[str, Field(max_length=200)]
    score: Annotated[float, Field(ge=0, le=1)]
    track_id: int | None = None
    keypoints: Annotated[list[tuple[Number, Number, Number]], Field(max_length=1000)] | None = None

    def within(self, width: int, height: int) -> Detection | None:
        """Convert to a detection clipped to the image; None if the clipped box is empty."""
        left, right = (min(max(edge, 0.0), float(width)) for edge in self.box[::2])
        top, bottom = (min(max(edge, 0.0), float(height)) for edge in self.box[1::2])
        if left >= right or top >= bottom:
            return None
        points = None if self.keypoints is None else np.array(self.keypoints, np.float32)
        box = (left, top, right, bottom)
        return Detection(box, self.label, self.score, self.track_id, points)


class _Answer(BaseModel):
    detections: Annotated[list[_Found], Field(max_length=_MOST_DETECTIONS)]


class FunctionUrl:
    """Client of a detection function, for the analysis `name`."""

    def __init__(self, connection: Connection, name: str) -> None:
        self._connection = connection
        self._headers = {"Content-Type": "image/jpeg", "X-Analysis": name}

    def check(self) -> None:
        """Test the function with a grey image.

        Raises ConfigError if the URL or the secret is wrong, EndpointError if the reply is not
        as specified.
        """
        reply = self._post(_GREY, None)
        refuse_denied(reply, self._connection.url)
        if reply.status in _GONE:
            raise ConfigError(
                f"{self._connection.url} takes no JPEG by POST (status {reply.status}: "
                f"{reply.text}); check endpoint.url"
            )
        self._read(reply, *_GREY.shape[1::-1])

    def detect(
        self,
        frame: Frame,
        budget: float | None,
        classes: Sequence[str] | None = None,
        min_score: float = 0.0,
    ) -> Detections:
        """Detect the objects in a frame.

        Args:
            frame: The frame.
            budget: Wall seconds for the reply, as for `Connection.ask`.
            classes: Labels to keep; None for all.
            min_score: Least confidence of a detection, 0 to 1.

        Raises:
            EndpointError: Without a valid reply.
        """
        found = self._read(self._post(frame.image, budget), frame.width, frame.height)
        wanted = [
            one
            for one in found
            if one.score >= min_score and (classes is None or one.label in classes)
        ]
        return Detections.of(frame, wanted)

    def _post(self, image: np.ndarray, budget: float | None) -> Reply:
        import cv2  # noqa: PLC0415 - 10 MB, for those who send pictures only

        written, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        if not written:
            raise EndpointError(f"a frame of {image.shape} cannot be written as JPEG")
        url, headers = self._connection.url.get_secret_value(), self._headers
        return self._connection.ask(
            "POST", url, body=jpeg.tobytes(), headers=headers, budget=budget
        )

    def _read(self, reply: Reply, width: int, height: int) -> list[Detection]:
        failures = self._connection.failures
        if reply.status != HTTPStatus.OK:
            failures["status"] += 1
            text = f"{self._connection.url}: status {reply.status}: {reply.text}"
            raise EndpointError(text)
        try:
            answer = _Answer.model_validate_json(reply.body)
        except ValidationError as error:
            failures["garbage"] += 1
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"]) or "the reply"
            text = f"{self._connection.url}: not the agreed JSON: {place}: {first['msg']}"
            raise EndpointError(text) from None
        within = (one.within(width, height) for one in answer.detections)
        return [one for one in within if one is not None]
