"""The link to a Tello on a clock that the test moves: what is on the wire, when, and when not."""

from __future__ import annotations

import errno
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from typing_extensions import Self

from aerodaas.extensions.tello import link as module
from aerodaas.extensions.tello.commands import LAND, STILL, TAKE_OFF, VERSION, Command, Sticks
from aerodaas.extensions.tello.link import TelloLink
from aerodaas.extensions.tello.settings import TelloSettings
from aerodaas.extensions.tello.state import TelloState

TELLO = ("192.168.10.1", 8889)
STATE = b"pitch:0;roll:0;yaw:0;vgx:0;vgy:0;vgz:0;templ:60;temph:63;tof:10;h:0;bat:%d;baro:1;time:0;"
TWICE = Command("twice", timeout=1.0, tries=2)
ONCE = Command("once", timeout=1.0)


class _Socket:
    """A UDP socket without a wire."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self.inbox: list[tuple[bytes, str, int]] = []
        self.broken: OSError | None = None
        self.closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.closed = True

    def sendto(self, content: bytes, peer: tuple[str, int]) -> None:
        """Send, if the Wi-Fi is there."""
        if self.broken is not None:
            raise self.broken
        assert peer == TELLO
        assert not self.closed
        self._wire.said.append((round(self._wire.now, 3), content.decode()))


class Wire:
    """A link, its sockets and its clock; all runs in the thread of the test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.said: list[tuple[float, str]] = []
        self.noted: list[bool] = []
        self.goodbyes = 0
        self.states: list[tuple[int, float]] = []
        self.turns: list[float] = []
        self.replies: list[str | None] = []
        self.opened: dict[str, tuple[object, ...]] = {}
        self._later: list[tuple[float, Callable[[], None]]] = []
        self.commands, self.statuses = _Socket(self), _Socket(self)

        def bound(name: str, port: int, *, address: str, interface: str, raises: type) -> _Socket:
            self.opened[name] = (port, address, interface, raises.__name__)
            return self.commands if len(self.opened) == 1 else self.statuses

        def taken(source: _Socket) -> list[tuple[bytes, str, int]]:
            arrived, source.inbox = source.inbox, []
            return arrived

        def guard(sender: _Socket, peer: tuple[str, int]) -> Any:  # noqa: ANN401
            assert (sender, peer) == (self.commands, TELLO)
            return SimpleNamespace(restart=self._note, close=self._goodbye)

        clock = SimpleNamespace(monotonic=lambda: self.now)
        for name, fake in (
            ("bound_socket", bound),
            ("datagrams", taken),
            ("time", clock),
            ("DeadMan", guard),
        ):
            monkeypatch.setattr(module, name, fake)
        monkeypatch.setattr(TelloLink, "_start", lambda _: None)
        settings = TelloSettings(local_address="127.0.0.5", interface="wlan7")
        self.link = TelloLink("t", settings, self._state, self.turns.append)
        self.link.open()

    def _note(self, *, moving: bool) -> None:
        self.noted.append(moving)

    def _goodbye(self) -> None:
        self.goodbyes += 1

    def _state(self, state: TelloState, now: float) -> None:
        self.states.append((state.battery, round(now, 3)))

    def at(self, second: float, deed: Callable[[], None]) -> None:
        """Do something at a second from 100 on, while the link runs."""
        self._later.append((100.0 + second, deed))

    def run(self, until: float) -> None:
        """Turn the link, forty times a second, until a second from 100 on."""
        while self.now < 100.0 + until:
            self.now = round(self.now + 0.025, 6)
            while self._later and self._later[0][0] <= self.now + 1e-9:
                self._later.pop(0)[1]()
            self.link.step()

    def reply(self, content: bytes, sender: tuple[str, int] = TELLO) -> None:
        """A packet at the commands' port."""
        self.commands.inbox.append((content, *sender))

    def ask(self, command: Command, *, urgent: bool = False) -> None:
        """Request a command; its reply is written down."""
        self.link.request(command, self.replies.append, urgent=urgent)

    def heard(self) -> list[str]:
        """What the Tello was told."""
        return [text for _, text in self.said]

    def seconds(self) -> list[float]:
        """When, from 100 on."""
        return [round(at - 100.0, 3) for at, _ in self.said]


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    """An open link."""
    return Wire(monkeypatch)


def test_the_ports_are_those_of_the_settings(wire: Wire) -> None:
    """Any for commands, 8890 for states; at the address and the interface of this Tello."""
    ours = ("127.0.0.5", "wlan7", "VehicleError")
    assert wire.opened == {"t, commands": (0, *ours), "t, state": (8890, *ours)}


def test_one_command_after_the_other(wire: Wire) -> None:
    """The second a tenth of a second after the reply to the first, not with it."""
    wire.ask(ONCE)
    wire.ask(TWICE)
    wire.at(0.4, lambda: wire.reply(b" ok\r\n"))
    wire.run(1.0)
    assert wire.heard() == ["once", "twice"]
    first, second = wire.seconds()
    assert first <= 0.05
    assert 0.5 <= second <= 0.551
    assert wire.replies == ["ok"]


def test_a_command_without_a_reply_is_given_up(
    wire: Wire, caplog: pytest.LogCaptureFixture
) -> None:
    """After its own time, as often as it may be said; the next one waits half a second more."""
    wire.ask(TWICE)
    wire.ask(ONCE)
    wire.run(1.4)
    assert wire.heard() == ["twice"]
    assert wire.link.counts.timeouts == 1
    wire.run(2.4)
    assert wire.heard() == ["twice", "twice"]
    assert wire.replies == []
    wire.run(2.9)
    assert wire.replies == [None]
    assert wire.link.counts.timeouts == 2
    wire.run(6.0)
    assert wire.heard() == ["twice", "twice", "once"]
    assert wire.replies == [None, None]
    assert caplog.messages == ["t: no reply to 'twice'", "t: no reply to 'once'"]
    one, two, three = wire.seconds()
    assert 1.5 <= two - one <= 1.6
    assert 1.5 <= three - two <= 1.6


def test_an_urgent_command_goes_first_and_at_once(wire: Wire) -> None:
    """Those that waited, and the one under way, are forgotten; nobody is told of them."""
    wire.ask(VERSION)
    wire.ask(ONCE)
    wire.at(0.2, lambda: wire.reply(b"30"))
    wire.at(0.25, lambda: wire.ask(LAND, urgent=True))
    wire.at(0.6, lambda: wire.reply(b"ok"))
    wire.run(5.0)
    assert wire.heard() == ["sdk?", "land"]
    assert wire.seconds()[1] <= 0.301
    assert wire.replies == ["30", "ok"]
    wire.ask(TAKE_OFF)
    wire.ask(ONCE)
    wire.run(5.2)
    wire.ask(LAND, urgent=True)
    wire.run(5.4)
    assert wire.heard()[2:] == ["takeoff", "land"]
    wire.reply(b"ok")
    wire.run(10.0)
    assert wire.heard()[2:] == ["takeoff", "land"]
    assert wire.replies == ["30", "ok", "ok"]


def test_which_replies_are_whose(wire: Wire) -> None:
    """From the Tello's own port, to a command that is under way, and of its kind."""
    wire.reply(b"ok")
    wire.run(0.1)
    assert wire.link.counts.stray_replies == 1
    wire.ask(VERSION)
    wire.run(0.2)
    wire.reply(b"ok")
    wire.reply(b"\xff\xfe")
    wire.reply(b"\xff\xfe")
    wire.reply(b"30", ("192.168.10.1", 8890))
    wire.reply(b"30", ("192.168.10.2", 8889))
    wire.run(0.3)
    counts = wire.link.counts
    assert (counts.stray_replies, counts.malformed, counts.strangers) == (2, 2, 2)
    assert wire.replies == []
    wire.reply(b"30")
    wire.reply(b"30")
    wire.run(0.4)
    assert wire.replies == ["30"]
    assert counts.stray_replies == 3
    assert counts.timeouts == 0


def test_states_of_the_tello_and_of_nobody_else(
    wire: Wire, caplog: pytest.LogCaptureFixture
) -> None:
    """From its address and the port of the first; counted, with the second in which they came."""
    caplog.set_level("DEBUG")
    senders = (("192.168.10.1", 8889), ("192.168.10.9", 8889), ("192.168.10.1", 5000), TELLO)
    for battery, (host, port) in enumerate(senders, 81):
        wire.statuses.inbox.append((STATE % battery, host, port))
    wire.statuses.inbox.insert(1, (b"nonsense" * 11, *TELLO))
    wire.run(0.05)
    counts = wire.link.counts
    assert (counts.states, counts.strangers, counts.malformed) == (2, 2, 1)
    assert caplog.messages == [f"t: not a state packet: {b'nonsense' * 10!r}"]
    assert [battery for battery, _ in wire.states] == [81, 84]
    assert all(100.0 < now <= 100.05 for _, now in wire.states)


def test_states_come_from_another_port_only_after_a_silence(wire: Wire) -> None:
    """A Tello that was switched off and on may use another one; five seconds are waited."""
    moved = ("192.168.10.1", 6000)
    for second in range(12):
        wire.statuses.inbox.append((STATE % 50, *moved) if second else (STATE % 80, *TELLO))
        wire.run(0.5 * (second + 1))
    assert wire.states[0][0] == 80
    assert [battery for battery, _ in wire.states[1:]] == [50]
    assert wire.states[1][1] > 105.0
    assert wire.link.counts.strangers == 10


def test_the_driver_gets_twenty_turns_a_second(wire: Wire) -> None:
    """The first at once."""
    wire.run(1.0)
    assert 19 <= len(wire.turns) <= 21
    assert wire.turns[0] <= 100.05
    gaps = [after - before for before, after in zip(wire.turns, wire.turns[1:], strict=False)]
    assert min(gaps) >= 0.05 - 1e-6


def test_each_steering_is_one_word(wire: Wire) -> None:
    """The newest, at the next turn; what it is, is remembered, and the guard is told."""
    ahead, aside = Sticks(ahead=40), Sticks(right=-30)
    wire.link.steer(aside)
    wire.link.steer(ahead)
    wire.run(0.2)
    assert wire.heard() == ["rc 0 40 0 0"]
    assert (wire.link.flown, wire.link.counts.sticks) == (ahead, 1)
    assert wire.noted == [True]
    wire.link.steer(ahead)
    wire.link.steer(STILL)
    wire.run(0.4)
    assert wire.heard() == ["rc 0 40 0 0", "rc 0 0 0 0"]
    assert (wire.link.flown, wire.link.counts.sticks) == (STILL, 2)
    assert wire.noted == [True, False]


def test_sticks_that_nobody_renews_are_centred_three_times(wire: Wire) -> None:
    """After three tenths of a second, each; then the wire is silent."""
    wire.link.steer(Sticks(ahead=40))
    wire.run(10.0)
    assert wire.heard() == ["rc 0 40 0 0"] + ["rc 0 0 0 0"] * 3
    start, *centred = wire.seconds()
    assert start <= 0.05
    assert [0.3 * (index + 1) <= at <= 0.4 * (index + 1) for index, at in enumerate(centred)] == [
        True
    ] * 3
    assert wire.link.flown == STILL
    assert wire.noted == [True, False, False, False]
    assert wire.link.counts.sticks == 4
    wire.link.steer(Sticks(up=10))
    wire.run(20.0)
    assert wire.heard()[4:] == ["rc 0 0 10 0"] + ["rc 0 0 0 0"] * 3


def test_sticks_that_are_renewed_in_time_are_never_centred(wire: Wire) -> None:
    """Each quarter of a second."""
    for quarter in range(8):
        wire.at(quarter / 4, lambda: wire.link.steer(Sticks(ahead=40)))
    wire.run(2.0)
    assert wire.heard() == ["rc 0 40 0 0"] * 8


def test_released_sticks_say_nothing_more(wire: Wire) -> None:
    """No centring during a take-off or a landing, which it would disturb; the guard rests."""
    wire.link.steer(Sticks(ahead=40))
    wire.run(0.1)
    wire.link.steer(Sticks(ahead=50))
    wire.link.release()
    assert wire.link.flown == STILL
    assert wire.noted == [True, False]
    wire.run(5.0)
    assert wire.heard() == ["rc 0 40 0 0"]


def test_before_anybody_steers_the_wire_is_silent(wire: Wire) -> None:
    """No `rc` of the link's own accord."""
    wire.run(5.0)
    assert wire.said == []
    assert wire.link.flown == STILL


def test_wifi_that_goes_is_remembered_until_it_comes_back(wire: Wire) -> None:
    """What cannot be sent is a failure, and no exception."""
    wire.commands.broken = OSError(errno.ENETUNREACH, "Network is unreachable")
    wire.ask(TWICE)
    wire.run(0.5)
    assert wire.link.failure is wire.commands.broken
    wire.commands.broken = None
    wire.run(2.0)
    assert [wire.link.failure] == [None]
    assert wire.heard() == ["twice"]


@pytest.mark.parametrize(("last", "said"), [(LAND, ["land"]), (None, [])])
def test_the_last_command_is_sent_before_the_ports_are_freed(
    wire: Wire, last: Command | None, said: list[str]
) -> None:
    """Without waiting for a reply; the thread ends, and the guard is told goodbye."""
    wire.ask(ONCE)
    wire.link.close(last)
    assert wire.heard() == said
    assert wire.goodbyes == 1
    assert wire.commands.closed
    assert wire.statuses.closed
