"""Missions as the service's answers show them."""

from __future__ import annotations

from aerodaas.protocol.schemas import MissionOut, MissionPhase, VerdictOut
from aerodaas.service.errors import without_folders
from aerodaas.service.mission import ActiveMission

__all__ = ["shown"]


def shown(one: ActiveMission) -> MissionOut:
    """A mission with its newest state: of its flight while it goes on, else as it ended."""
    row = one.row
    outcome = one.flight.outcome() if one.over else None
    told = None if one.link is None else one.link.mission
    newest = outcome or told
    flying = None if one.over else told
    verdict = VerdictOut.model_validate(row.verdict) if row.verdict else None
    if verdict is not None:
        reasons = [without_folders(reason) for reason in verdict.reasons]
        verdict = verdict.model_copy(update={"reasons": reasons})
    if verdict is not None and one.rehearsal.picture.is_file():
        verdict = verdict.model_copy(update={"picture": f"/v1/missions/{row.id}/rehearsal.png"})
    return MissionOut(
        id=row.id,
        name=row.name,
        tenant=row.tenant,
        account=row.account,
        phase=row.phase,
        reason=without_folders(one.waits_for or row.reason),
        robots=list(row.robots),
        lease=row.lease,
        share=list(row.request.get("share", ())),
        attach=one.attached_to,
        grants=one.grants,
        submitted=row.submitted,
        started=row.started,
        ended=row.ended,
        verdict=verdict,
        status={} if newest is None else newest.status,
        told={} if flying is None else flying.told,
        alerts=[] if newest is None else newest.alerts,
        streams={} if flying is None else flying.streams,
        analytics=None if flying is None else flying.analytics,
        recording=one.phase is not MissionPhase.FLYING and one.flight.recording.is_file(),
    )
