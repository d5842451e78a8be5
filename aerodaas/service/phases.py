"""Which phase of a mission may follow which."""

from __future__ import annotations

from aerodaas.protocol.schemas import MissionPhase

__all__ = ["FOLLOWING"]

_P = MissionPhase
FOLLOWING = {
    _P.SUBMITTED: {_P.REHEARSING, _P.AWAITING_APPROVAL, _P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.REHEARSING: {_P.AWAITING_APPROVAL, _P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.AWAITING_APPROVAL: {_P.QUEUED, _P.REFUSED, _P.CANCELLED},
    _P.QUEUED: {_P.FLYING, _P.REFUSED, _P.CANCELLED, _P.FAILED},
    _P.FLYING: {_P.LANDED, _P.CANCELLED, _P.FAILED},
}
"""Phases that may follow each one."""
