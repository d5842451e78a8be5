"""Guests: applications of others, which have what the owner grants and no way to the rest."""

from __future__ import annotations

import os
import re
import socket
import tempfile
import textwrap
from pathlib import Path
from typing import Any

import psutil
import pytest
from flying import FLAT, Flyer, hop, recorded, robot

from aerodaas import Analytics, Environment, Odometry
from aerodaas.actors.cluster.ray_variables import AUTH_MODE, VARIABLES
from aerodaas.analytics.base import Context
from aerodaas.analytics.guests.process import GuestProcess
from aerodaas.config.grants import parse_words
from aerodaas.config.options import current_options
from aerodaas.environment.guests import admit_guests
from aerodaas.environment.run import Run
from aerodaas.errors import ConfigError
from aerodaas.messages.readings import Readings
from aerodaas.recording.reader import Recording

HEAD = """
import os, sys, time
from aerodaas import AeroListData, AeroNavigation, Analytics, Environment, Odometry, Waypoint
from aerodaas.analytics import NavigableAnalytics, RemoteAnalytics
from aerodaas.messages.readings import Readings

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
"""
GUEST = (
    HEAD
    + '''
class HighWater(Analytics[Readings]):
    """The greatest height so far; a class of the guest's own file."""

    accepts = (Odometry,)
    highest = 0.0

    def process(self, item, context):
        self.highest = max(self.highest, item.height)
        return Readings(context.now(), {"highest": self.highest})

edge = env.get_compute_resource_by_id("edge")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
watch = HighWater().deploy(edge)
watch.analyse(odometry)
'''
)
READY = "drone.start_mission()\n"
GOES_ON = "drone.start_mission(wait=False)\nstream.get_data()"
RIGHTS = ("sense:odom_drone", "compute:edge")
CONTENT = {**FLAT, "schedulers": {"trajectory": "ordered"}}


@pytest.fixture
def guest(tmp_path: Path) -> Path:
    """Where a guest's file goes: nothing of the owner's is there."""
    (tmp_path / "elsewhere").mkdir()
    return tmp_path / "elsewhere" / "theirs.py"


def owner(env: Environment) -> None:
    """Two waypoints."""
    env.get_robot_by_id("drone").navigate(hop((6, 0), (6, 6)))


def admitted(flyer: Flyer, guest: Path, text: str, *rights: str) -> tuple[Environment, list[str]]:
    """An owner's environment with this guest, and why the guest was left out."""
    guest.write_text(text)
    with flyer.options(guests=(guest,), grants={"theirs": rights}):
        env = Environment(flyer.write(CONTENT))
        owner(env)
        notes = admit_guests(current_options.get(), env)
        return env, [note.text for note in notes if note.kind == "guest_refused"]


def refusal(flyer: Flyer, guest: Path, text: str, *rights: str) -> str:
    """Why a guest was left out; the owner's graph is as it was."""
    env, refused = admitted(flyer, guest, text, *rights)
    assert len(refused) == 1
    assert refused[0].startswith("the guest theirs does not take part: ")
    assert not [node for node in env.graph.nodes.values() if node.kind != "sensor"]
    assert len(env.graph.navigation) == 1
    return refused[0]


@pytest.mark.parametrize(
    ("text", "rights", "said"),
    [
        (
            "drone.navigate(AeroNavigation(data=[Waypoint('m', 1, 1, 2)]))",
            (),
            "fly:drone.*navigate",
        ),
        (
            "env.trajectory_scheduler().add_navigation(AeroListData([Waypoint('m', 1, 0, 2)]))",
            (),
            "fly:drone.*theirs.py:.*add_navigation",
        ),
        ("drone.get_sensor_by_id('odom_drone')", (), "odom_drone.*theirs.py:.*get_sensor_by_id"),
        ("env.get_compute_resource_by_id('edge')", ("sense",), "no compute resource"),
        ("sys.exit(3)", (), r"sys.exit\(3\)"),
        ("os._exit(3)", (), "ended, with code 3"),
        ("raise RuntimeError('boo')", (), "RuntimeError: boo at theirs.py"),
        ("x = bytearray(1 << 30)", ("memory:400",), "MemoryError"),
        (
            "stream = drone.get_sensor_by_id('odom_drone').get_data_stream()\n" + GOES_ON,
            ("sense:odom_drone",),
            "only `aerodaas run` flies",
        ),
        ("this is no python", (), "SyntaxError"),
        ("", (), "never called start_mission"),
    ],
)
def test_a_guest_that_cannot_take_part_is_left_out(
    flyer: Flyer, guest: Path, text: str, rights: tuple[str, ...], said: str
) -> None:
    """By name, with its line; the owner's process and graph are as they were."""
    ready = READY if text else ""
    if text.startswith("this"):
        ready = ""
    found = refusal(flyer, guest, HEAD + text + "\n" + ready, *rights)
    assert re.search(f"(?s){said}", found), found


def poses(run: Run) -> list[object]:
    """The flown trajectory, to the last digit, and the setpoints behind it."""
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        return [
            (one.topic, one.value)
            for one in recording.records(topics={"/drone/state", "/drone/setpoints"})
        ]


def analysis(process: str, rest: str = "") -> str:
    """A guest whose analysis of odometry does this with each item."""
    body = textwrap.indent(textwrap.dedent(process), "        ")
    return (
        f"{HEAD}class Mine(Analytics[object]):\n"
        f"    count = 0\n"
        f"    def process(self, item, context):\n"
        f"        self.count += 1\n{body}\n"
        "edge = env.get_compute_resource_by_id('edge')\n"
        "odometry = drone.get_sensor_by_id('odom_drone').get_data_stream()\n"
        f"mine = Mine().deploy(edge)\nresults = mine.analyse(odometry)\n{rest}\n{READY}"
    )


class OwnersEye(Analytics[Readings]):
    """An analysis of the owner's."""

    def process(self, item: Odometry, context: Context) -> Readings:
        """The height."""
        return Readings(context.now(), {"height": item.height})


def owner_who_looks(env: Environment) -> None:
    """Two waypoints and an analysis."""
    owner(env)
    drone, edge = env.get_robot_by_id("drone"), env.get_compute_resource_by_id("edge")
    OwnersEye().deploy(edge).analyse(drone.get_sensor_by_id("odom_drone").get_data_stream())


def alerts(run: Run, kind: str = "") -> list[str]:
    """Texts of the recorded alerts."""
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        found = [one.value for one in recording.records(topics={"/alerts"})]
    return [one["text"] for one in found if kind in {"", one["kind"]}]


def results_of(run: Run, analysis: str) -> int:
    """Number of recorded results of an analysis."""
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        return sum(analysis in one.topic for one in recording.records())


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The owner's flight without guests."""
    return Flyer(tmp_path_factory.mktemp("alone")).fly(owner_who_looks, CONTENT, seed=3)


def test_a_guest_sees_what_it_is_granted(flyer: Flyer, guest: Path, alone: Run) -> None:
    """Its class runs on the owner's sensor; its flight is that of the owner alone, to the digit."""
    guest.write_text(GUEST + READY)
    run = flyer.fly(owner_who_looks, CONTENT, guests=(guest,), grants={"theirs": RIGHTS}, seed=3)
    assert "drone/theirs_high_water" in recorded(run).latencies
    assert alerts(run) == alerts(alone)
    assert len(poses(alone)) > 100
    assert poses(run) == poses(alone)


BAD = {
    "raising": ("if self.count == 5: raise ValueError('boo')", "ValueError: boo"),
    "quitting": (
        "if self.count == 5: os._exit(4)",
        "has been ended: its process has ended, with code 4",
    ),
    "exiting": ("if self.count == 5: sys.exit(4)", "has been ended"),
    "hanging": ("while self.count == 5: pass", "has been ended: did not answer in time"),
    "hoarding": ("self.x = bytearray(4 << 30)", "MemoryError"),
    "flooding": ("return [0.0] * 5_000_000", "too large|has been ended"),
    "killing": ("os.kill(os.getppid(), 9); return 1", "killing"),
}
"""What an analysis of a guest does, and what is told of it."""


def unopened() -> str:
    """A guest whose analysis ends its process before it is asked for anything."""
    opening = "    count = 0\n    def open(self):\n        os._exit(9)\n"
    return analysis("return 1").replace("    count = 0\n", opening)


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory, alone: Run) -> tuple[Run, list[str]]:
    """The owner's flight with all bad guests at once, and the alerts that there are more of."""
    folder = tmp_path_factory.mktemp("crowd")
    texts = {name: analysis(process) for name, (process, _) in BAD.items()}
    texts |= {"unopened": unopened(), "refused": HEAD + "sys.exit(0)"}
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    guests = tuple(folder / f"{name}.py" for name in texts)
    grants = dict.fromkeys(BAD, RIGHTS) | {"unopened": RIGHTS}
    run = Flyer(folder).fly(owner_who_looks, CONTENT, guests=guests, grants=grants, seed=3)
    return run, [text for text in alerts(run) if text not in alerts(alone)]


def test_bad_guests_together_leave_the_owners_flight_as_it_is(
    crowd: tuple[Run, list[str]], alone: Run
) -> None:
    """Its analysis goes on, and the flight is the same to the digit; each guest is told once."""
    run, found = crowd
    assert poses(run) == poses(alone)
    assert results_of(run, "owners_eye") == results_of(alone, "owners_eye") > 50
    assert len(found) == len(BAD) + 2


@pytest.mark.parametrize("name", BAD)
def test_a_bad_analysis_is_told_by_its_guests_name(crowd: tuple[Run, list[str]], name: str) -> None:
    """With what it has done."""
    (told,) = [text for text in crowd[1] if name in text]
    assert re.search(BAD[name][1], told)


def test_a_guest_that_fails_to_open_is_told(crowd: tuple[Run, list[str]]) -> None:
    """As ended."""
    (told,) = [text for text in crowd[1] if "unopened" in text]
    assert "the guest unopened has been ended" in told


def test_a_refused_guest_is_told_and_the_owner_flies(crowd: tuple[Run, list[str]]) -> None:
    """One that exits while it builds, of which today's run would end."""
    (told,) = alerts(crowd[0], "guest_refused")
    assert "refused does not take part" in told


@pytest.mark.parametrize("granted", [True, False], ids=["namespaces", "none"])
def test_the_owner_is_told_of_a_guest_that_is_not_confined(
    flyer: Flyer, guest: Path, monkeypatch: pytest.MonkeyPatch, *, granted: bool
) -> None:
    """Where the machine grants no namespaces, and only there."""

    class Started(GuestProcess):
        def __init__(self, *how: Any) -> None:  # noqa: ANN401 - as its base
            super().__init__(*how)
            self.isolated = granted

    monkeypatch.setattr("aerodaas.environment.guests.GuestProcess", Started)
    guest.write_text(GUEST + READY)
    with flyer.options(guests=(guest,), grants={"theirs": RIGHTS}):
        env = Environment(flyer.write(CONTENT))
        owner(env)
        notes = admit_guests(current_options.get(), env)
    assert [note.kind for note in notes] == ([] if granted else ["guest_unconfined"])
    assert all("the guest theirs can use the network" in note.text for note in notes)


NAVIGATOR = (
    HEAD
    + """
class Ahead(NavigableAnalytics):
    done = False
    def process(self, item, context):
        if not self.done and item.height > 1.0:
            self.done = True
            return AeroNavigation(data=[Waypoint("theirs", 3, 3, 2, priority=1)])

edge = env.get_compute_resource_by_id("edge")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
ahead = Ahead().deploy(edge).analyse(odometry)
drone.navigate(ahead)
"""
)


def test_a_guest_that_is_granted_it_flies(flyer: Flyer, guest: Path) -> None:
    """By its own analysis, beside the owner's waypoints and by the same checks."""
    guest.write_text(NAVIGATOR + READY)
    rights = (*RIGHTS, "fly:drone")
    content = {**CONTENT, "robots": [robot(mission={"on_complete": "return"})]}
    run = flyer.fly(owner_then_home, content, guests=(guest,), grants={"theirs": rights})
    assert run.state is not None
    assert "theirs" in run.state.robots["drone"].status.visited


def owner_then_home(env: Environment) -> None:
    """Two waypoints; a reading above the last one ends the mission, for a live stream is open."""
    drone, edge = env.get_robot_by_id("drone"), env.get_compute_resource_by_id("edge")
    drone.navigate(hop((6, 0), (6, 6)))
    odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
    eye = OwnersEye().deploy(edge)
    eye.analyse(odometry)
    eye.trigger(drone.end_mission, when=_Later(20.0))


class _Later:
    """Condition that holds after some mission time."""

    def __init__(self, at: float) -> None:
        self.at = at

    def __call__(self, reading: Readings) -> bool:
        return reading.stamp > self.at * 1e9


FORGED = """
class Forger(Analytics[AeroNavigation]):
    def process(self, item, context):
        return {forged}

edge = env.get_compute_resource_by_id("edge")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
flight = Forger().deploy(edge).analyse(odometry)
"""


def test_a_stream_of_navigation_without_the_right_reaches_no_drone(
    flyer: Flyer, guest: Path, alone: Run
) -> None:
    """It may be computed, and is recorded; only `navigate` would fly it, and that is refused."""
    forged = "AeroNavigation(data=[Waypoint('theirs', 99, 99, 9, priority=0)])"
    text = HEAD + FORGED.format(forged=forged)
    assert "fly:drone" in refusal(flyer, guest, f"{text}drone.navigate(flight)\n{READY}", *RIGHTS)
    guest.write_text(text + READY)
    run = flyer.fly(owner_who_looks, CONTENT, guests=(guest,), grants={"theirs": RIGHTS}, seed=3)
    assert poses(run) == poses(alone)


@pytest.fixture(scope="module")
def forgers(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A flight with a guest for each forgery, all of whom may fly."""
    folder = tmp_path_factory.mktemp("forgers")
    reckless = "class Reckless:\n    def __reduce__(self):\n        return os.abort, ()\n"
    for name, value in FORGERIES.items():
        text = HEAD + reckless + FORGED.format(forged=value) + "drone.navigate(flight)\n" + READY
        (folder / f"{name}.py").write_text(text)
    guests = tuple(folder / f"{name}.py" for name in FORGERIES)
    grants = dict.fromkeys(FORGERIES, (*RIGHTS, "fly:drone"))
    return Flyer(folder).fly(owner_then_home, CONTENT, guests=guests, grants=grants)


FORGERIES = {
    "number": "42.0",
    "words": "['a']",
    "reckless": "Reckless()",
    "reading": "Odometry([0, 0, 0], [0, 0, 0], 0.0)",
}


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_navigation_is_refused(forgers: Run, name: str) -> None:
    """Though the guest may fly: what is no navigation is told, and the drone flies on."""
    assert forgers.state is not None
    assert forgers.state.robots["drone"].status.visited == ("wp0", "wp1")
    assert any(name in text for text in alerts(forgers, "analysis_failed"))


PRYING = """
seen = {}
class Prying(Analytics[object]):
    def process(self, item, context):
        import ctypes, socket
        found = {"names": list(os.environ), "parent": os.getppid(), "nice": os.nice(0)}
        found["token"] = os.path.exists(TOKEN) or os.path.exists(os.path.expanduser("~/.ray"))
        found["shared"] = os.listdir("/dev/shm") + os.listdir("/tmp")
        try:
            open(OWNERS, "w").close()
            found["writes"] = True
        except OSError:
            found["writes"] = False
        try:
            found["uncovers"] = not ctypes.CDLL(None).umount2(b"/dev/shm", 2)
            open(f"/proc/{PID}/environ").read()
            found["reads"] = True
        except OSError:
            found["reads"] = False
        try:
            socket.create_connection(("127.0.0.1", PORT), 1).close()
            found["network"] = True
        except OSError:
            found["network"] = False
        return found

edge = env.get_compute_resource_by_id("edge")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
Prying().deploy(edge).analyse(odometry)
"""


def test_a_guest_is_not_handed_secrets(
    flyer: Flyer, guest: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither Ray's token or address nor the owner's variables; with namespaces, no network."""
    monkeypatch.setenv("OWNERS_SECRET", "s3cret")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        token = Path("~/.ray/auth_token").expanduser()
        places = {"PORT": port, "TOKEN": repr(str(token)), "OWNERS": repr(str(__file__) + ".no")}
        text = PRYING
        for name, place in {**places, "PID": os.getpid()}.items():
            text = text.replace(name, str(place))
        guest.write_text(HEAD + text + READY)
        run = flyer.fly(owner, CONTENT, guests=(guest,), grants={"theirs": RIGHTS})
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        records = recording.records(topics={"/drone/theirs_prying/value"})
        found = [one.value["value"] for one in records]
    given = {"PATH", "LANG", "LC_ALL", "LC_CTYPE", "TZ", "HOME", "TMPDIR", "OMP_NUM_THREADS"}
    # The last of these are set by imports, of Ray and of what imports it.
    own = {"PYTHONDONTWRITEBYTECODE", "RAY_CLIENT_MODE", AUTH_MODE, *VARIABLES}
    assert not set(found[0]["names"]) & set(os.environ) - given - own
    assert found[0]["nice"] >= 15
    # In namespaces of its own the parent's id is 0: the owner's processes cannot be named.
    if found[0]["parent"] == 0:
        assert not any(found[0][one] for one in ("token", "writes", "uncovers", "reads", "network"))
        assert not [name for name in found[0]["shared"] if "ray" in name or "iox" in name]


def test_quotas_and_grants_are_told_with_their_numbers(flyer: Flyer, guest: Path) -> None:
    """Too many analyses, a source that is too fast; what the owner has wrong stops the start."""
    many = "".join(f"HighWater().deploy(edge).analyse(odometry)  # {n}\n" for n in range(4))
    said = refusal(flyer, guest, GUEST + many + READY, *RIGHTS)
    assert "has 5 analyses, and may have 4" in said
    text = GUEST + "fast = HighWater()\nfast.rate = 50.0\nfast.deploy(edge).instantiate()\n"
    assert "50 Hz, and may have 20" in refusal(flyer, guest, text + READY, *RIGHTS)
    said = refusal(flyer, guest, GUEST + "watch.trigger(drone.end_mission)\n" + READY, *RIGHTS)
    assert "fly:drone" in said
    said = refusal(
        flyer, guest, GUEST + "RemoteAnalytics().deploy(edge).analyse(odometry)\n" + READY, *RIGHTS
    )
    assert "remote" in said
    for wrong, match in {
        "senes:cam": "no right",
        "sense:nothing": "nothing of that name",
        "memory:lots": "whole number",
    }.items():
        with pytest.raises(ConfigError, match=match):
            admitted(flyer, guest, GUEST + READY, wrong)
    with pytest.raises(ConfigError, match="GUEST=RIGHT"):
        parse_words(["sense"])
    assert parse_words(["a=sense:x,compute", "a=fly"]) == {"a": ("sense:x", "compute", "fly")}


def test_an_owner_is_told_of_what_is_not_there(flyer: Flyer, guest: Path) -> None:
    """A file that is missing, rights for a guest that does not come."""
    with flyer.options(guests=(guest.with_name("nobody.py"),)):
        env = Environment(flyer.write(CONTENT))
        with pytest.raises(ConfigError, match="no application"):
            admit_guests(current_options.get(), env)
    guest.write_text(GUEST + READY)
    with flyer.options(guests=(guest,), grants={"others": ("sense",)}):
        env = Environment(flyer.write(CONTENT))
        with pytest.raises(ConfigError, match="no such guest"):
            admit_guests(current_options.get(), env)


def test_a_guest_that_hangs_while_it_builds(
    flyer: Flyer, guest: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is ended, with what it has started, and its folder is gone."""
    monkeypatch.setattr("aerodaas.environment.guests._BUILD_SECONDS", 8.0)
    before = {one.pid for one in psutil.process_iter()}
    text = f"{HEAD}import subprocess\nsubprocess.Popen(['sleep', '77.25'])\nwhile True: pass\n"
    assert "did not answer in time" in refusal(flyer, guest, text)
    left = [one.info for one in psutil.process_iter(["pid", "cmdline"])]
    fresh = [one["cmdline"] or [] for one in left if one["pid"] not in before]
    assert not [words for words in fresh if "77.25" in words or any("sandbox" in w for w in words)]
    assert not list(Path(tempfile.gettempdir()).glob("aerodaas-guest-theirs-*"))


FORGED_DOCUMENT = """
import aerodaas.environment.guest_process as inside

class Forged:
    def model_dump(self, mode):
        return {content}

inside._document = lambda environment: Forged()
"""


def forged(nodes: str = "[]", navigation: str = "[]") -> str:
    """A guest that sends a document of its own making."""
    content = f'{{"version": 1, "nodes": {nodes}, "navigation": {navigation}}}'
    return HEAD + FORGED_DOCUMENT.format(content=content) + READY


def node(**words: object) -> dict[str, object]:
    """An analysis of a document."""
    own = {"id": "drone/a", "robot": "drone", "inputs": ["drone/odom_drone"], "compute": "edge"}
    return {**own, **words}


@pytest.mark.parametrize(
    ("text", "rights", "said"),
    [
        (forged(f"[{node()}]"), ("compute",), "sense:drone/odom_drone"),
        (forged(f"[{node(inputs=['drone/@state'])}]"), RIGHTS, "its document"),
        (forged(f"[{node(inputs=['other'])}]"), RIGHTS, "sense:other"),
        (forged(f"[{node(compute='cloud')}]"), RIGHTS, "compute:cloud"),
        (forged(f"[{node(robot='others')}]"), RIGHTS, "no robot"),
        (forged(f"[{node(inputs=['drone/a'])}]"), RIGHTS, "circle"),
        (forged(f"[{node()}, {node()}]"), RIGHTS, "one id"),
        (
            forged(f"[{node(triggers=[{'target': 'drone', 'method': 'end_mission'}])}]"),
            RIGHTS,
            "fly:drone",
        ),
        (
            forged(f"[{node(navigation=True)}]", "[{'robot': 'drone', 'stream': 'drone/a'}]"),
            RIGHTS,
            "fly:drone",
        ),
        (
            forged(f"[{node()}]", "[{'robot': 'drone', 'stream': 'drone/a'}]"),
            (*RIGHTS, "fly"),
            "cannot navigate by",
        ),
        (
            forged("[]", "[{'robot': 'drone', 'waypoints': [{'is': 'Waypoint', 'of': {}}]}]"),
            ("fly",),
            "Waypoint.id: Field required",
        ),
        (forged("['x' * (100 << 20)]"), RIGHTS, "too large"),
        (HEAD + "os.write(4, b'nonsense' * 1000); os.write(3, b'nonsense' * 1000)", (), "guest"),
    ],
)
def test_a_forged_document_is_refused(
    flyer: Flyer, guest: Path, text: str, rights: tuple[str, ...], said: str
) -> None:
    """By the owner, whatever the guest has made of its own process."""
    assert said in refusal(flyer, guest, text, *rights)


def test_a_guest_is_scheduled_as_the_owner_is(flyer: Flyer, guest: Path) -> None:
    """By the owner's analytics scheduler, in its own actor, which takes tasks of frames."""
    guest.write_text(
        HEAD
        + "class Mean(Analytics[float]):\n"
        + "    scheduled = True\n"
        + "    def process(self, item, context):\n"
        + "        return float(item.image.mean())\n"
        + "camera = drone.get_sensor_by_id('cam').get_data_stream()\n"
        + "Mean().deploy(env.get_compute_resource_by_id('edge')).analyse(camera)\n"
        + READY
    )
    camera = {"id": "cam", "rate": 5, "settings": {"width": 64, "height": 48}}
    schedulers = {"trajectory": "ordered", "analytics": "edf"}
    content = {**FLAT, "robots": [robot(sensors=[camera])], "schedulers": schedulers}
    rights = ("sense:cam", "compute:edge")
    run = flyer.fly(owner, content, guests=(guest,), grants={"theirs": rights})
    assert results_of(run, "theirs_mean") > 10
