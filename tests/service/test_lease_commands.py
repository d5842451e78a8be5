"""`aerodaas lease` against a service: what it asks for, and what it prints."""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable, Iterator

import pytest
from served import Served, fleet, robot
from typer.testing import CliRunner, Result

from aerodaas.cli.app import app

pytestmark = pytest.mark.wall_clock

Lease = Callable[..., Result]
NUMBERS = itertools.count()


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Two drones without cameras."""
    with Served(fleet(robot("one"), robot("two", 10))) as served:
        yield served


@pytest.fixture
def lease(provider: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lease]:
    """The command, as a pilot; the leases of each test are given back."""
    token = provider.user(f"pilot{next(NUMBERS)}", "farm")
    monkeypatch.setenv("AERODAAS_TOKEN", token)
    monkeypatch.setenv("AERODAAS_PROVIDER", provider.url)
    yield lambda *words: CliRunner().invoke(app, ["lease", *words])
    for one in provider.ask("GET", "/v1/leases"):
        provider.ask("DELETE", f"/v1/leases/{one['id']}")


def asked(lease: Lease, *words: str) -> dict[str, object]:
    """Ask for a lease; returns its JSON."""
    found: dict[str, object] = json.loads(lease("ask", *words, "--json").stdout)
    return found


def test_a_lease_is_asked_for_extended_and_given_back(lease: Lease, provider: Served) -> None:
    """Each command tells the lease as the service has it."""
    id_ = str(asked(lease, "one", "--minutes", "10")["id"])
    assert provider.ask("GET", f"/v1/leases/{id_}")["minutes"] == 10
    longer = json.loads(lease("extend", id_, "5", "--json").stdout)
    assert (longer["id"], longer["minutes"], longer["state"]) == (id_, 15, "granted")
    assert lease("extend", id_, "5").stdout.startswith(f"{id_}: one: granted until 20")
    assert lease("give-back", id_).stdout == f"{id_}: one: ended, given back\n"
    assert provider.ask("GET", f"/v1/leases/{id_}")["state"] == "ended"


def test_everything_that_the_service_takes_can_be_asked_for(lease: Lease) -> None:
    """The queue says what for, and until when."""
    area = "-5,-5 20,-5 20,20 -5,20"
    words = ("--within", "50", "--near", "12,-1", "--battery-minutes", "1", "--area", area)
    found = asked(lease, *words)
    assert found["robots"] == ["two"], "the nearest"
    assert found["area"] == [[-5, -5], [20, -5], [20, 20], [-5, 20]]
    text = lease("ask", "two").stdout
    assert ": two: queued for 15 min" in text
    table = lease("list").stdout
    assert "granted" in table
    assert "queued" in table
    assert [one["state"] for one in json.loads(lease("list", "--json").stdout)] == [
        "granted",
        "queued",
    ]


def test_waiting_ends_with_the_grant(lease: Lease, provider: Served) -> None:
    """Which comes when the one before is given back."""
    first = asked(lease, "one")

    def give_back() -> None:
        provider.until(lambda: len(provider.ask("GET", "/v1/leases")) == 2)
        provider.ask("DELETE", f"/v1/leases/{first['id']}")

    giver = threading.Thread(target=give_back)
    giver.start()
    found = asked(lease, "one", "--wait")
    giver.join()
    assert found["state"] == "granted"
    assert found["id"] != first["id"]


def test_waiting_for_what_is_revoked_is_told(lease: Lease, provider: Served) -> None:
    """With the reason, as a failure."""
    first = asked(lease, "one")
    ended: list[Result] = []
    waiting = threading.Thread(target=lambda: ended.append(lease("ask", "one", "--wait")))
    waiting.start()
    provider.until(lambda: len(provider.ask("GET", "/v1/leases")) == 2)
    (queued,) = (one for one in provider.ask("GET", "/v1/leases") if one["id"] != first["id"])
    provider.ask("DELETE", f"/v1/leases/{queued['id']}")
    waiting.join()
    assert "has ended: revoked by admin" in str(ended[0].exception)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("ask", "three"), "no robot three; it has: one, two"),
        (("ask", "--camera"), "no drone of the fleet could ever fit"),
        (("ask", "one", "--minutes", "0"), "minutes: Input should be greater than 0"),
        (("ask", "one", "--near", "here"), "EAST,NORTH in metres"),
        (("ask", "one", "--area", "0,0 1,1"), "area: List should have at least 3 items"),
        (("extend", "none", "5"), "no lease none"),
        (("give-back", "none"), "no lease none"),
    ],
)
def test_what_cannot_be_had_is_told(lease: Lease, words: tuple[str, ...], said: str) -> None:
    """By one sentence, before or by the service."""
    assert said in str(lease(*words).exception)
