"""Recognition of a model: its family, and the names of its classes."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from aerodaas.analytics.detection.coco import COCO_NAMES
from aerodaas.analytics.detection.families.base import Decoder, ModelFamily
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["class_names", "recognise"]

_log = logging.getLogger(__name__)


def recognise(model: ModelFile, families: Sequence[ModelFamily]) -> Decoder:
    """Return the decoder of the first of `families` that the model belongs to.

    Args:
        model: The model.
        families: Families to ask, in order.

    Raises:
        ModelError: If it is made for another task, or belongs to none.
    """
    task = model.metadata.get("task", "detect")
    if task not in ("detect", "pose"):
        raise model.refusal(f"is made to {task}, not to detect", "choose a detect or pose model")
    decoder = next((found for family in families if (found := family(model))), None)
    if decoder is None:
        shapes = ", ".join(str(list(output.shape)) for output in model.outputs)
        problem = f"gives {shapes}, the output of no detector that is known here"
        remedy = "choose a YOLO detector, or pass a ModelFamily of your own in families="
        raise model.refusal(problem, remedy)
    return decoder


def class_names(model: ModelFile, decoder: Decoder, names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of a model's classes.

    Args:
        model: The model.
        decoder: Its decoder.
        names: Names that go before those of the file; None for none.

    Returns:
        `names`, or those of the file, or COCO's for 80 classes, or numbers.

    Raises:
        ModelError: If they are not as many as the model's classes.
    """
    given = tuple(names) if names is not None else model.names
    if given is None and decoder.classes == len(COCO_NAMES):
        _log.info("%s names no classes; its 80 are taken for COCO's", model.path)
        given = COCO_NAMES
    if given is None:
        _log.warning("%s names no classes; they are called by number", model.path)
        given = tuple(str(number) for number in range(decoder.classes))
    if len(given) != decoder.classes:
        problem = f"tells {decoder.classes} classes apart, but {len(given)} are named"
        raise model.refusal(problem, "give one name for each in names=")
    return given
