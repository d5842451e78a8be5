"""Analysis of a single item, at once and in the application's own process."""

from __future__ import annotations

import copy
import logging
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from aerodaas.errors import GraphError
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState

if TYPE_CHECKING:
    from aerodaas.analytics.base import Analytics, ComputeKind

__all__ = ["process_item"]

_log = logging.getLogger(__name__)
_opened: WeakKeyDictionary[Analytics[Any], Analytics[Any]] = WeakKeyDictionary()
"""Open copies of analyses; the analyses themselves may still be sent to actors."""


class _Context:
    """Context of an item that belongs to no mission."""

    kind: ComputeKind = "edge"

    def __init__(self, stamp: int) -> None:
        self._stamp = stamp

    def now(self) -> int:
        return self._stamp

    def vehicle(self) -> VehicleState | None:
        return None

    def alert(self, alert: Alert) -> None:
        _log.warning("%s", alert.text)


def process_item(analysis: Analytics[Any], item: object) -> Any:  # noqa: ANN401 - the analysis' own
    """Return what `analysis` makes of `item`; None where it finds nothing to say.

    A copy of the analysis is opened at the first item and kept for the next ones. Its context has
    the item's stamp (0 without one) and no vehicle; alerts are logged as warnings.

    Args:
        analysis: The analysis, deployed or not.
        item: An item of a type that the analysis accepts.

    Raises:
        GraphError: If the analysis does not accept the item.
        Exception: What the analysis' `open` or `process` raises.
    """
    if not isinstance(item, analysis.accepts):
        accepted = " or ".join(one.__name__ for one in analysis.accepts)
        name = type(analysis).__name__
        raise GraphError(f"{name} takes a {accepted}, not a {type(item).__name__}")
    opened = _opened.get(analysis)
    if opened is None:
        opened = copy.copy(analysis)
        opened.open()
        _opened[analysis] = opened
    header = getattr(item, "header", None)
    return opened.process(item, _Context(getattr(header, "stamp", 0)))
