"""Phases of a mission at the service, and which follows which."""

from __future__ import annotations

from aerodaas.protocol.schemas import MissionPhase

__all__ = ["FOLLOWING", "OVER"]

_P = MissionPhase
OVER = frozenset(one for one in MissionPhase if one.over)
"""Phases that nothing follows."""
FOLLOWING = {
    _P.SUBMITTED: {_P.REHEARSING, _P.AWAITING_APPROVAL, _P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.REHEARSING: {_P.AWAITING_APPROVAL, _P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.AWAITING_APPROVAL: {_P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.QUEUED: {_P.FLYING, _P.REFUSED, _P.CANCELLED, _P.FAILED},
    _P.FLYING: {_P.LANDED, _P.CANCELLED, _P.FAILED},
}
"""Phases that may follow each one."""
