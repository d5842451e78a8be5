"""MAVLink FTP's client against bad links and bad servers, by a clock of its own."""

from __future__ import annotations

import random
import struct
from collections import deque
from collections.abc import Callable, Iterator
from typing import TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.extensions.vehicle_logs.ftp import (
    FtpClient,
    FtpEntry,
    FtpPacket,
    FtpRefusedError,
    FtpScript,
)
from aerodaas.testing.channel import Channel, Impairment
from tools.mavlink_vehicle.files import FileServer

T = TypeVar("T")
PATH = "/logs/1.bin"
CONTENT = random.Random(1).randbytes(60_000)
PEER = ("", 0)
STEP = 0.01
PATIENCE = 60.0
"""Seconds after which every client must have given up."""


class World:
    """A client, a server and the link between them; seconds are the world's own."""

    def __init__(
        self,
        answer: Callable[[bytes], list[bytes]],
        bad: Impairment | None = None,
        seed: int = 0,
        pace: float = 0.0,
    ) -> None:
        bad = bad or Impairment(delay=STEP)
        self._pace = pace
        self.client = FtpClient()
        self.now = 0.0
        self.sent: list[FtpPacket] = []
        self._inbox: deque[bytes] = deque()
        self._answer = answer
        self._up = Channel(bad, f"{seed}/up", lambda content, _: self._serve(content))
        self._down = Channel(bad, f"{seed}/down", lambda content, _: self._inbox.append(content))

    def _serve(self, payload: bytes) -> None:
        for count, answer in enumerate(self._answer(payload)):
            self._down.send(answer, PEER, self.now + count * self._pace)

    def run(self, script: FtpScript[T]) -> T:
        """What a script ends with."""
        self.client.now = self.now
        try:
            turn = next(script)
            while True:
                for packet in turn.packets:
                    self.sent.append(packet)
                    self._up.send(packet.pack(), PEER, self.now)
                turn = script.send((self._heard(turn.until), self.now))
                assert self.now < PATIENCE
        except StopIteration as ended:
            value: T = ended.value
            return value

    def _heard(self, until: float) -> FtpPacket | None:
        while self.now < until:
            while self._inbox:
                packet = FtpPacket.unpack(self._inbox.popleft())
                if packet is not None:
                    return packet
            self.now += STEP
            self._up.deliver(self.now)
            self._down.deliver(self.now)
        return None

    def read(self, size: int, begin: int = 0) -> bytes:
        """A file of so many bytes, from `begin` on."""
        content = bytearray()
        self.run(self.client.read(PATH, size, content.extend, begin))
        return bytes(content)


def serving(content: bytes = CONTENT) -> FileServer:
    """A server with one file."""
    server = FileServer()
    server.files[PATH] = content
    return server


bad_links = st.builds(
    Impairment,
    loss=st.floats(0.0, 0.2),
    duplicates=st.floats(0.0, 0.5),
    late=st.floats(0.0, 0.1),
    lateness=st.floats(0.0, 3.0),
    delay=st.floats(0.0, 0.3),
    jitter=st.floats(0.0, 0.3),
)


@given(bad=bad_links, seed=st.integers(0, 1000), size=st.integers(0, 40_000), data=st.data())
@settings(max_examples=25, deadline=None)
def test_a_file_comes_whole_over_a_bad_link(
    bad: Impairment, seed: int, size: int, data: st.DataObject
) -> None:
    """Whatever is lost, doubled, late or overtaken: every byte once, in order; or it is told."""
    begin = data.draw(st.integers(0, size))
    world = World(serving(CONTENT[:size]).answer, bad, seed)
    content = bytearray()
    try:
        world.run(world.client.read(PATH, size, content.extend, begin))
    except VehicleError as error:
        # Six losses in a row, or the end of the file told twice.
        assert bad.loss > 0.0 or bad.late > 0.0, error  # noqa: PT017
        assert CONTENT[begin:size].startswith(content)
    else:
        assert content == CONTENT[begin:size]


def test_gaps_are_asked_for_by_themselves() -> None:
    """One packet of a burst is lost: its 239 bytes come again, and nothing else does."""
    server = serving()
    lost = [2390]

    def answer(payload: bytes) -> Iterator[bytes]:
        for reply in server.answer(payload):
            packet = FtpPacket.unpack(reply)
            assert packet is not None
            if packet.offset in lost:
                lost.clear()
            else:
                yield reply

    world = World(lambda payload: list(answer(payload)))
    assert world.read(len(CONTENT)) == CONTENT
    assert [(one.offset, one.size) for one in world.sent if one.opcode == 5] == [(2390, 239)]
    assert [one.offset for one in world.sent if one.opcode == 15] == [0, 23_900, 47_800]
    assert world.now < 1.0


def test_a_slow_link_is_given_its_time() -> None:
    """Nothing is asked for again while anything new comes, and no round counts that brought it."""
    world = World(serving(CONTENT[:5_000]).answer, pace=0.3)
    assert world.read(5_000) == CONTENT[:5_000]
    assert [one.opcode for one in world.sent] == [4, 15]
    assert world.now > 5.0

    large = random.Random(2).randbytes(300_000)
    assert World(serving(large).answer).read(len(large)) == large


def test_what_comes_far_ahead_is_not_kept() -> None:
    """Of a vehicle that sends an end without a beginning nothing fills our memory."""
    size = 400_000
    server = serving(bytes(size))

    def answer(payload: bytes) -> list[bytes]:
        if payload[3] != mavlink.MAV_FTP_OPCODE_BURSTREADFILE:
            return server.answer(payload)
        sequence, session = struct.unpack_from("<HB", payload)
        end = FtpPacket(128, sequence + 1, session, 200, 15, offset=size - 200, content=bytes(200))
        return [end.pack()]

    world = World(answer)
    with pytest.raises(VehicleError, match="at byte 0 of 400000"):
        world.read(size)
    assert not [one for one in world.sent if one.opcode == 5]


pieces = st.tuples(st.integers(0, 3_000), st.integers(0, 239), st.booleans(), st.booleans())


@given(st.lists(pieces, max_size=5), st.integers(1, 2_500))
@settings(max_examples=30, deadline=None)
def test_true_pieces_of_any_size_make_the_file(
    told: list[tuple[int, int, bool, bool]], size: int
) -> None:
    """In any order, one over another, by either kind of answer; beyond the end they are cut off."""
    server = serving(CONTENT[:size])
    left = deque(told)

    def answer(payload: bytes) -> list[bytes]:
        sequence, _, opcode = struct.unpack_from("<HBB", payload)
        made: list[bytes] = []
        while left and len(made) < 5 and opcode in {5, 15}:
            at, count, burst, complete = left.popleft()
            content = CONTENT[at : at + count]
            kind = 15 if burst else 5
            packet = FtpPacket(128, sequence, 3, len(content), kind, complete, at, content)
            made.append(packet.pack())
        return [*made, *(server.answer(payload) if len(made) < 5 else ())]

    assert World(answer).read(size) == CONTENT[:size]


def test_a_server_that_stalls_is_told_with_the_byte() -> None:
    """After six times of asking."""
    server = serving()

    def answer(payload: bytes) -> list[bytes]:
        packets = map(FtpPacket.unpack, server.answer(payload))
        return [one.pack() for one in packets if one is not None and one.offset < 30_000]

    with pytest.raises(VehicleError, match=r"stopped sending .*1\.bin at byte 30114 of 60000"):
        World(answer).read(len(CONTENT))
    with pytest.raises(VehicleError, match="does not answer when asked for its files"):
        World(lambda _: []).read(len(CONTENT))


def test_a_size_that_is_a_lie(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than there is, or another than what was listed."""
    server = serving()
    monkeypatch.setattr(server, "size", lambda _: len(CONTENT) + 10)
    with pytest.raises(VehicleError, match="ends before byte 60010"):
        World(server.answer).read(60_010)
    with pytest.raises(VehicleError, match="60010 bytes, and was said to have 60000: it is still"):
        World(server.answer).read(60_000)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ((1,), "it failed"),
        ((2, 5), "error 02 05"),
        ((7,), "does not know how"),
        ((9,), "may not be read"),
        ((), "not told"),
    ],
)
def test_refusals_are_worded(code: tuple[int, ...], words: str) -> None:
    """To each request."""

    def refusing(payload: bytes) -> list[bytes]:
        sequence, _, opcode = struct.unpack_from("<HBB", payload)
        answer = FtpPacket(129, sequence + 1, 0, len(code), opcode, content=bytes(code))
        return [answer.pack()]

    world = World(refusing)
    with pytest.raises(FtpRefusedError, match=words):
        world.read(10)
    with pytest.raises(FtpRefusedError, match=words):
        world.run(world.client.entries("/logs"))


def test_a_server_that_restarts_is_asked_again() -> None:
    """The file is opened anew, and goes on where it was."""
    server = serving()
    bursts: list[int] = []

    def answer(payload: bytes) -> list[bytes]:
        if payload[3] == mavlink.MAV_FTP_OPCODE_BURSTREADFILE:
            bursts.append(struct.unpack_from("<I", payload, 8)[0])
            if len(bursts) == 2:
                server.restart()
        return server.answer(payload)

    assert World(answer).read(len(CONTENT)) == CONTENT
    assert bursts == [0, 23_900, 23_900, 47_800]


def test_what_a_cut_link_left_open_is_closed_at_last() -> None:
    """Others get three seconds to end theirs."""
    server = serving()
    World(server.answer).read(len(CONTENT))
    world = World(server.answer)
    assert world.read(len(CONTENT)) == CONTENT
    assert world.now > 3.0
    assert [one.opcode for one in world.sent[:6]] == [4, 4, 4, 4, 4, 2]


def names_told(*told: bytes) -> list[FtpEntry]:
    """What the client makes of a listing."""
    server = FileServer()
    server.listing = lambda _: list(told)  # type: ignore[method-assign]
    world = World(server.answer)
    return world.run(world.client.entries("/logs"))


@given(st.lists(st.binary(min_size=1, max_size=40).filter(lambda told: 0 not in told), max_size=9))
@settings(max_examples=30, deadline=None)
def test_any_listing_can_be_read(told: list[bytes]) -> None:
    """Names without ways out, sizes of zero and more."""
    for name, size in names_told(b"S", *told):
        assert name.strip(".")
        assert not {"/", "\\"} & set(name)
        assert size is None or size >= 0


def test_a_folder_without_end_is_given_up() -> None:
    """Rather than filling our memory."""

    def endless(payload: bytes) -> list[bytes]:
        sequence, _, opcode = struct.unpack_from("<HBB", payload)
        entries = b"Da\0" * 60
        return [FtpPacket(128, sequence + 1, 0, len(entries), opcode, content=entries).pack()]

    world = World(endless)
    with pytest.raises(VehicleError, match="more than 10000 files in /logs"):
        world.run(world.client.entries("/logs"))


noise = st.lists(
    st.builds(
        lambda opcode, sequence, request, complete, offset, content: FtpPacket(
            opcode, sequence, 3, len(content), request, complete, offset, content
        ),
        st.sampled_from([128, 129]),
        st.integers(0, 20),
        st.sampled_from([3, 4, 5, 14, 15]),
        st.booleans(),
        st.one_of(st.integers(0, 3_000), st.integers(0, 0xFFFFFFFF)),
        st.binary(max_size=60),
    ),
    max_size=60,
)


@given(noise, st.integers(0, 2000))
@settings(max_examples=25, deadline=None)
def test_nonsense_ends_in_time(told: list[FtpPacket], size: int) -> None:
    """Whatever comes beside the answers: no other error, no byte too many, no endless wait."""
    server = serving(CONTENT[:size])
    left = deque(told)

    def answer(payload: bytes) -> list[bytes]:
        made = [left.popleft().pack() for _ in range(min(3, len(left)))]
        return [*made, *server.answer(payload)]

    world = World(answer)
    content = bytearray()
    try:
        world.run(world.client.read(PATH, size, content.extend))
    except VehicleError:
        assert told
    assert len(content) <= size


@pytest.mark.parametrize("damaged", [b"", b"\0" * 11, b"\0\0\0\x80\xff" + bytes(246)])
def test_what_is_no_packet(damaged: bytes) -> None:
    """Too short for its own head, or for the bytes that it is said to carry."""
    assert FtpPacket.unpack(damaged) is None
