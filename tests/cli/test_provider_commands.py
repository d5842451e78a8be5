"""Commands at a provider's service: what they print, for people and for programs."""

from __future__ import annotations

import io
import json
import stat
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Ended, ran
from provider_stub import MISSION, TOKEN, Stub, mission

from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.environment.provider import exchange
from aerodaas.environment.provider.logins import Logins
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.proposals import ProposalOut
from aerodaas.protocol.schemas import MissionPhase, VerdictOut

APP = """
import sys
from aerodaas import *
env = Environment("environments/farm.json")
drone = env.get_robot_by_id("drone")
drone.navigate(AeroListData([Waypoint(sys.argv[1], 2, 0, 2)]))
drone.start_mission()
"""


Command = Callable[..., Ended]


@pytest.fixture
def aerodaas(
    stub: Stub, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Command:
    """The command line, logged in by the environment."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AERODAAS_TOKEN", TOKEN)
    monkeypatch.setenv("AERODAAS_PROVIDER", stub.url)
    monkeypatch.setattr("aerodaas.terminal.console.show_results", lambda *_, **__: None)
    monkeypatch.setattr(exchange, "_FIRST_PAUSE", 0.01)
    (tmp_path / "app.py").write_text(APP)
    return lambda *words: ran(capsys, *words)


def test_the_fleet_is_a_table_or_json(aerodaas: Command) -> None:
    """Free or leased, charge, whether it would take off, sensors."""
    shown = aerodaas("fleet").out
    assert all(word in shown for word in ("campus", "drone", "free", "75%", "refused", "odom"))
    assert json.loads(aerodaas("fleet", "--json").out)["robots"][0]["battery"] == 0.75


def test_missions_are_listed(aerodaas: Command, stub: Stub) -> None:
    """With phase and reason; control characters of another's name do not reach the terminal."""
    stub.state = mission(MissionPhase.QUEUED, name="odd\x1b[2Jname", reason="waits for its drones")
    shown = aerodaas("missions", "list").out
    assert all(word in shown for word in (MISSION, "queued", "waits for its drones"))
    assert "\x1b[2J" not in shown
    listed = json.loads(aerodaas("missions", "list", "--json").out)
    assert [one["id"] for one in listed] == [MISSION]


def test_an_application_is_submitted_watched_and_recorded(
    aerodaas: Command, stub: Stub, tmp_path: Path
) -> None:
    """Unchanged: its environment is the provider's; words after -- are its own."""
    stub.state = mission(MissionPhase.LANDED, recording=True)
    words = ["--seed", "3", "--minutes", "4", "--no-view", "--record", "out"]
    ended = aerodaas("submit", "app.py", *words, "--", "first")
    assert ended.code == 0, ended.said
    (sent,) = [json.loads(one) for one in stub.sent("POST", "/v1/missions")]
    assert (sent["seed"], sent["minutes"]) == (3, 4)
    assert sent["document"]["name"] == "app"
    assert sent["document"]["navigation"][0]["waypoints"][0]["id"] == "first"
    assert (tmp_path / "out" / "flight.mcap").read_bytes() == b"recorded"
    ended = aerodaas("submit", "app.py", "--json", "--record", "again", "--", "first")
    assert json.loads(ended.out)["phase"] == "landed"


def test_a_document_is_submitted_without_being_waited_for(
    aerodaas: Command, stub: Stub, tmp_path: Path
) -> None:
    """It says how to follow the mission; for programs, its id."""
    stub.state = mission(MissionPhase.QUEUED)
    ended = aerodaas("submit", "app.py", "--no-wait", "--json", "--", "first")
    assert json.loads(ended.out)["id"] == MISSION
    (document,) = [json.loads(one)["document"] for one in stub.sent("POST", "/v1/missions")]
    (tmp_path / "mission.json").write_text(json.dumps(document))
    ended = aerodaas("submit", "mission.json", "--no-wait")
    assert ended.out == f"{MISSION} is submitted; aerodaas missions watch {MISSION} follows it\n"
    first, second = (json.loads(one) for one in stub.sent("POST", "/v1/missions"))
    assert first["document"]["navigation"] == second["document"]["navigation"]
    assert stub.sent("DELETE", MISSION) == []


def test_what_is_code_needs_its_user(aerodaas: Command, stub: Stub, tmp_path: Path) -> None:
    """With --no-wait there is none: the refusal says so, and nothing is sent."""
    hooked = APP.replace("drone.start", "drone.on_end(lambda: None)\ndrone.start")
    (tmp_path / "app.py").write_text(hooked)
    ended = aerodaas("submit", "app.py", "--no-wait", "--", "first")
    assert ended.code == 2
    assert "hooks" in ended.said
    assert stub.sent("POST", "/v1/missions") == []


def test_a_refused_mission_ends_with_one(aerodaas: Command, stub: Stub) -> None:
    """With the provider's reason, also where it is watched."""
    stub.state = mission(MissionPhase.REFUSED, reason="wp1 lies outside the fence")
    for words in (["submit", "app.py", "--no-view", "--", "first"], ["missions", "watch", MISSION]):
        ended = aerodaas(*words)
        assert ended.code == 1
        assert "refused: wp1 lies outside the fence" in ended.said


def test_a_mission_is_watched_until_it_is_over(aerodaas: Command, stub: Stub) -> None:
    """One JSON object a line, for programs."""
    stub.state = mission(MissionPhase.LANDED)
    lines = aerodaas("missions", "watch", MISSION, "--json").out.splitlines()
    assert json.loads(lines[-1])["phase"] == "landed"
    assert f"aerodaas missions fetch {MISSION}" in aerodaas("missions", "watch", MISSION).out


def test_a_mission_is_cancelled(aerodaas: Command, stub: Stub) -> None:
    """In flight, its drones come home first."""
    assert "come home" in aerodaas("missions", "cancel", MISSION).out
    stub.state = mission(MissionPhase.CANCELLED)
    assert json.loads(aerodaas("missions", "cancel", MISSION, "--json").out)["phase"] == "cancelled"
    assert len(stub.sent("DELETE", MISSION)) == 2


@pytest.mark.parametrize("answer", ["y", "n"])
def test_a_proposal_is_approved_as_it_is_shown(
    aerodaas: Command, stub: Stub, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    """After a look and a word: by its hash, with the actuators that were named."""
    proposal = ProposalOut(
        hash="a" * 64,
        document=MissionDocument.model_validate({"format": "aerodaas-mission", "version": 1}),
        minutes=5.0,
        why="approve\x1b[2Jit",
        summary=["one flies to 3 waypoints."],
        difference=["one: waypoint 2 moves."],
        actuators=["one/hook"],
    )
    verdict = VerdictOut(approved=True, seconds=70.0, battery_used=0.25)
    stub.state = mission(MissionPhase.AWAITING_APPROVAL, proposal=proposal, verdict=verdict)
    monkeypatch.setattr(sys, "stdin", io.StringIO(f"{answer}\n"))
    ended = aerodaas("missions", "approve", MISSION, "--actuator", "one/hook")
    told = ("3 waypoints", "waypoint 2 moves", "one/hook", "70 s", "25%")
    assert [word for word in told if word not in ended.out] == []
    assert "\x1b[2J" not in ended.out
    sent = [json.loads(one) for one in stub.sent("POST", "/approve")]
    approval = {"hash": "a" * 64, "envelope": None, "actuators": ["one/hook"]}
    assert (ended.code, sent) == ((0, [approval]) if answer == "y" else (1, []))


def test_a_recording_is_fetched_and_nothing_overwritten(
    aerodaas: Command, stub: Stub, tmp_path: Path
) -> None:
    """To the file that is named, or the mission's."""
    assert aerodaas("missions", "fetch", MISSION).code == 0
    assert (tmp_path / f"{MISSION}.mcap").read_bytes() == b"recorded"
    ended = aerodaas("missions", "fetch", MISSION)
    assert (ended.code, "already exists" in ended.said) == (2, True)
    ended = aerodaas("missions", "fetch", MISSION, "-o", "own.mcap", "--json")
    assert json.loads(ended.out) == {"mission": MISSION, "file": "own.mcap", "bytes": 8}
    stub.refusals["/v1/missions"] = (404, {"text": "it has no recording yet"})
    ended = aerodaas("missions", "fetch", MISSION, "-o", "none.mcap")
    assert (ended.code, "no recording yet" in ended.said) == (2, True)


def test_a_recording_is_deleted_once_it_is_here(
    aerodaas: Command, stub: Stub, tmp_path: Path
) -> None:
    """And not where it could not be fetched or written."""
    (tmp_path / "there.mcap").write_bytes(b"another")
    assert aerodaas("missions", "fetch", MISSION, "-o", "there.mcap", "--delete").code == 2
    assert aerodaas("missions", "fetch", MISSION, "-o", "there.mcap/in.mcap", "--delete").code == 2
    stub.refusals["/v1/missions"] = (404, {"text": "it has no recording yet"})
    assert aerodaas("missions", "fetch", MISSION, "--delete").code == 2
    stub.refusals.clear()
    assert stub.sent("DELETE", "/recording") == []
    assert aerodaas("missions", "fetch", MISSION, "--delete").code == 0
    assert (tmp_path / f"{MISSION}.mcap").read_bytes() == b"recorded"
    assert stub.sent("DELETE", "/recording") == [b""]


def test_a_login_is_tried_and_stored(
    aerodaas: Command, stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For this user alone; a token that is not taken is not stored."""
    monkeypatch.delenv("AERODAAS_TOKEN")
    monkeypatch.delenv("AERODAAS_PROVIDER")
    assert "aerodaas login" in aerodaas("fleet", "--at", stub.url).said
    monkeypatch.setattr(sys, "stdin", io.StringIO("wrong\n"))
    assert aerodaas("login", stub.url).code == 2
    assert Logins().urls() == []
    account = {"name": "ann", "tenant": "farmers", "role": "pilot", "scopes": [], "created": 1.0}
    stub.refusals["/v1/me"] = (200, account)
    monkeypatch.setattr(sys, "stdin", io.StringIO(f"{TOKEN}\n"))
    ended = aerodaas("login", stub.url)
    assert ended.out.startswith("ann of farmers (pilot)")
    assert TOKEN not in ended.out + ended.said
    assert stat.S_IMODE(Logins().path.stat().st_mode) == 0o600
    assert json.loads(aerodaas("fleet", "--json").out)["name"] == "campus"
    assert "forgot" in aerodaas("login", stub.url, "--forget").out
    assert aerodaas("fleet").code == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["fleet", "--at", "provider.example"], "a provider's address is https://host"),
        (["fleet", "--at", "http://10.0.0.1"], "AERODAAS_INSECURE"),
        (["submit", "none.py"], "there is no application none.py"),
        (["submit", "app.py", "--silence", "wait", "--", "x"], "continue or return, not 'wait'"),
        (["submit", "app.py", "--minutes", "0"], "--minutes"),
        (["missions", "watch"], "Missing argument"),
    ],
)
def test_bad_words_are_usage_errors(aerodaas: Command, words: list[str], said: str) -> None:
    """One message with the remedy; the exit code is 2."""
    ended = aerodaas(*words)
    assert said in " ".join(ended.said.split())
    assert ended.code == AeroDaaSError.exit_code + 1
