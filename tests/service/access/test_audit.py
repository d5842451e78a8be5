"""The audit log tells who did what, in bounds, and lets nothing that needs it pass unwritten."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerodaas.protocol.schemas import USUAL_SCOPES, Role
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import StoreError
from aerodaas.service.store import AuditEntry, Store

PILOT = Principal("pilot", "farm", Role.PILOT, frozenset(USUAL_SCOPES), "0" * 16)


def test_an_entry_has_who_what_and_whether(store: Store) -> None:
    """Newest first."""
    audit = Audit(store, lambda: 12.5)
    audit.write(PILOT, "lease.request", "l1", "15 minutes", accepted=True, address="::1")
    audit.write(None, "token.refused", accepted=False)
    shown = audit.newest(9)
    assert [entry.action for entry in shown] == ["token.refused", "lease.request"]
    _, entry = shown
    assert (entry.at, entry.account, entry.target, entry.text) == (
        12.5,
        "pilot",
        "l1",
        "15 minutes",
    )
    assert entry.accepted
    assert entry.address == "::1"


def test_texts_of_strangers_are_cut_and_command_no_terminal(store: Store) -> None:
    """Names as well."""
    audit = Audit(store)
    audit.write(None, "x" * 10_000, "\x1b[2J\n\0\ud800", "y" * 10_000, accepted=False)
    (entry,) = audit.newest(9)
    assert len(entry.action) == 100
    assert len(entry.text) == 500
    assert entry.text.endswith("…")
    assert entry.target.isprintable()
    assert "[2J" in entry.target


def test_only_the_newest_are_kept(store: Store) -> None:
    """With at most a thousand beyond them."""
    audit = Audit(store, most=5)
    old = AuditEntry(0.0, "pilot", "farm", "", "old", accepted=True)
    store.audit.add(*[old] * 990)
    for number in range(20):
        audit.write(PILOT, f"a{number}", accepted=True)
    kept = store.audit.newest(5000)
    assert len(kept) <= 5 + 1000
    assert len(kept) < 1000
    assert [entry.action for entry in kept[:3]] == ["a19", "a18", "a17"]


def test_what_needs_an_entry_fails_without_and_what_makes_safe_does_not(tmp_path: Path) -> None:
    """Late entries keep their moment and come with the next."""
    path, away = tmp_path / "service.db", tmp_path / "away.db"
    now = [1.0]
    with Store.open(path) as store:
        audit = Audit(store, lambda: now[0])
        path.rename(away)
        with pytest.raises(StoreError, match="is gone"):
            audit.write(PILOT, "mission.submit", accepted=True)
        audit.write(PILOT, "mission.cancel", accepted=True, required=False)
        now[0] = 2.0
        away.rename(path)
        audit.write(PILOT, "lease.request", accepted=True)
        shown = [(entry.at, entry.action) for entry in audit.newest(9)]
        assert shown == [(2.0, "lease.request"), (1.0, "mission.cancel")]
        audit.write(PILOT, "lease.extend", accepted=True)
        assert len(audit.newest(9)) == 3
