"""Missions as the service's answers show them."""

from __future__ import annotations

from aerodaas.protocol.schemas import MissionOut, MissionPhase, VerdictOut
from aerodaas.service.errors import without_folders
from aerodaas.service.mission import ActiveMission

__all__ = ["shown"]


def shown(one: ActiveMission) -> MissionOut:
    """A mission with its newest state: of its flight while it goes on, else as it ended."""
    row, link = one.row, one.link
    outcome = one.flight.outcome() if one.over else None
    news = link.news if link is not None else None
    status, alerts = (news.status, news.alerts) if news is not None else ({}, [])
    if outcome is not None:
        status, alerts = outcome.status, outcome.alerts
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
        status=status,
        told=news.told if news is not None and not one.over else {},
        alerts=alerts,
        streams=news.streams if news is not None and not one.over else {},
        analytics=news.analytics if news is not None and not one.over else None,
        recording=one.phase is not MissionPhase.FLYING and one.flight.recording.is_file(),
    )
