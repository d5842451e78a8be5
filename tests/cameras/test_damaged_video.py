"""Video with losses and damage: each picture that is handed on is one that was sent."""

from __future__ import annotations

import io
import queue
import random
import socket
import threading
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import av
import cv2
import numpy as np
import pytest
from av.codec.context import Flags
from av.packet import Packet
from hostile_rtsp import Server, fragmented, play, rtp_packet
from numpy.typing import NDArray

from aerodaas.cameras.h264 import FrameDecoder, bgr_image
from aerodaas.cameras.live import LiveSource
from aerodaas.config.secrets import SecretUrl

WIDTH, HEIGHT, COUNT, PERIOD = 320, 240, 200, 50
SMEARED = 12.0
"""Grey levels by which a picture differs from what was sent, on average; whole ones by 6."""

Stream = Sequence[tuple[int, bytes]]
"""Numbers and contents of frames."""


@cache
def pictures() -> NDArray[np.uint8]:
    """A camera that moves over ground that looks alike nowhere."""
    noise = np.random.default_rng(0).integers(0, 256, (30, 120, 3), np.uint8)
    ground = cv2.resize(noise, (1200, 300), interpolation=cv2.INTER_CUBIC)
    moved = [ground[:HEIGHT, 4 * number : 4 * number + WIDTH] for number in range(COUNT)]
    return np.ascontiguousarray(moved, np.uint8)


@cache
def encoded(codec: str = "libx264", more: str = "") -> tuple[tuple[int, bytes], ...]:
    """The frames, with a key frame every `PERIOD`."""
    encoder: Any = av.CodecContext.create(codec, "w")
    encoder.width, encoder.height, encoder.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    encoder.time_base, encoder.gop_size, encoder.thread_count = Fraction(1, 30), PERIOD, 1
    encoder.bit_rate = 1_000_000
    parameters = f"repeat-headers=1:scenecut=0:sliced-threads=0:slices=1{more}"
    if codec == "libx265":
        parameters = "repeat-headers=1:scenecut=0:log-level=none"
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        f"{codec.removeprefix('lib')}-params": parameters,
    }
    packets = []
    for number, picture in enumerate(pictures()):
        frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format="yuv420p")
        frame.pts = number
        packets += encoder.encode(frame)
    packets += encoder.encode(None)
    return tuple((packet.pts, bytes(packet)) for packet in packets)


def error(image: NDArray[np.uint8], number: int) -> float:
    """Mean difference to the picture of that number, grey levels."""
    return float(np.abs(image.astype(np.int16) - pictures()[number]).mean())


def shown(
    stream: Stream, codec: str = "h264", *, reorders: bool = False
) -> tuple[list[int], FrameDecoder]:
    """Numbers of the pictures that come out, all of which are as they were sent."""
    context: Any = av.CodecContext.create(codec, "r")
    if not reorders:
        context.flags |= Flags.low_delay
    decoder, numbers = FrameDecoder(context), []
    for number, content in stream:
        packet = Packet(content)
        packet.pts = number
        for picture in decoder.decode(packet):
            assert picture.pts is not None
            assert error(bgr_image(picture), picture.pts) < SMEARED
            numbers.append(picture.pts)
    return numbers, decoder


def flipped(content: bytes, seed: int) -> bytes:
    """With four wrong bits behind the headers."""
    draw, spoilt = random.Random(seed), bytearray(content)
    for _ in range(4):
        spoilt[draw.randrange(len(spoilt) // 4, len(spoilt))] ^= 1 << draw.randrange(8)
    return bytes(spoilt)


@pytest.mark.parametrize("lost", [1, 2, 10, 15, 16, 17, 29])
@pytest.mark.parametrize(("codec", "decoder"), [("libx264", "h264"), ("libx265", "hevc")])
def test_lost_frames_cost_all_up_to_the_next_key_frame(codec: str, decoder: str, lost: int) -> None:
    """However many: H.264's numbers of frames begin anew after 16 here."""
    stream = encoded(codec)
    numbers, found = shown([*stream[:20], *stream[20 + lost :]], decoder)
    assert numbers == [*range(20), *range(PERIOD, COUNT)]
    assert found.broken + found.waiting >= PERIOD - 20 - lost


@pytest.mark.parametrize(("codec", "decoder"), [("libx264", "h264"), ("libx265", "hevc")])
def test_a_lost_key_frame_costs_its_group(codec: str, decoder: str) -> None:
    """The frames behind it look as if they continued the group before."""
    stream = encoded(codec)
    numbers, found = shown([*stream[:PERIOD], *stream[PERIOD + 1 :]], decoder)
    assert numbers == [*range(PERIOD), *range(2 * PERIOD, COUNT)]
    assert found.waiting == PERIOD - 1


@pytest.mark.parametrize("spoil", [flipped, lambda content, _: content[: len(content) // 2]])
def test_damage_costs_all_up_to_the_next_key_frame(spoil: Callable[[bytes, int], bytes]) -> None:
    """Flipped bits, and a frame whose last packets are lost."""
    for seed in range(10):
        stream = list(encoded())
        stream[60] = 60, spoil(stream[60][1], seed)
        numbers, found = shown(stream)
        assert numbers == [*range(60), *range(2 * PERIOD, COUNT)]
        assert (found.broken, found.waiting) == (1, 2 * PERIOD - 61)


def test_a_stream_without_key_frames_comes_back_when_it_is_refreshed() -> None:
    """Where a column of each frame is new, pictures are whole once all columns are."""
    stream = encoded(more=":intra-refresh=1")
    numbers, _ = shown([*stream[:20], *stream[25:]])
    assert numbers[:20] == [*range(20)]
    assert PERIOD < numbers[20] < 2 * PERIOD
    assert numbers[20:] == [*range(numbers[20], COUNT)]


@pytest.mark.parametrize("more", ["", ":bframes=2:b-adapt=0", ":cqm=jvt:8x8dct=1", ":tff=1"])
def test_whole_streams_lose_nothing(more: str) -> None:
    """Nor do those with frames that none rests on, scaling lists, or fields."""
    numbers, found = shown(encoded(more=more), reorders="bframes" in more)
    # A decoder keeps what it may have to reorder.
    assert len(numbers) >= COUNT - 4
    assert found.broken == 0


def test_a_pause_of_the_camera_alone_is_no_loss() -> None:
    """The frames behind it follow the one before by number."""
    stream = encoded()
    late = [(number + 8 * (number > 70), content) for number, content in stream]
    decoder = FrameDecoder()
    count = 0
    for number, content in late:
        packet = Packet(content)
        packet.pts = number
        count += len(decoder.decode(packet))
    assert count == COUNT


def _serve(stream: Stream, pause: float) -> Callable[[socket.socket], None]:
    """A camera that sends these frames by RTP, and then nothing; numbers of packets go on."""

    def kind(client: socket.socket) -> None:
        play(client)
        sequence = 0
        sent = dict(stream)
        for number, content in encoded():
            units = [unit.rstrip(b"\0") for unit in content.split(b"\0\0\1") if unit.strip(b"\0")]
            payloads = [payload for unit in units for payload in fragmented(unit)]
            for index, payload in enumerate(payloads):
                if number in sent:
                    last = index == len(payloads) - 1
                    client.sendall(rtp_packet(payload, sequence, 3000 * number, last=last))
                sequence += 1
            time.sleep(pause)
        threading.Event().wait()

    return kind


@pytest.mark.wall_clock
def test_a_live_source_hands_on_no_smeared_picture_and_counts_what_it_left_out() -> None:
    """Ten frames and a key frame are lost on the way; every picture handed on was sent so."""
    stream = encoded()
    lost = {*range(70, 80), 2 * PERIOD}
    arriving = [(number, content) for number, content in stream if number not in lost]
    source = LiveSource(SecretUrl(Server(_serve(arriving, 0.02)).url))
    source.open()
    seen, end = 0, time.monotonic() + 60.0
    last = 0
    while last < COUNT - 2:
        assert time.monotonic() < end, f"{seen} pictures, the last {last}"
        newest = source.newest(10**12)
        if newest is None:
            time.sleep(0.002)
            continue
        errors = [error(newest[0], number) for number in range(COUNT)]
        seen, last = seen + 1, int(np.argmin(errors))
        assert errors[last] < SMEARED
        assert last < 70 or last >= 3 * PERIOD
    assert source.skipped >= 20 + PERIOD - 1
    source.close()


@pytest.mark.wall_clock
def test_rtsp_is_asked_for_by_udp_where_a_camera_refuses_tcp() -> None:
    """TCP first: it loses nothing."""
    asked: queue.SimpleQueue[bool] = queue.SimpleQueue()

    def accepts(request: bytes) -> bool:
        by_tcp = b"RTP/AVP/TCP" in request
        asked.put(by_tcp)
        return not by_tcp

    source = LiveSource(SecretUrl(Server(lambda client: play(client, accepts)).url))
    source.start()
    assert [asked.get(timeout=20.0) for _ in range(2)] == [True, False]
    source.close()


def _transport_stream(codec: str) -> bytes:
    """The frames as MPEG-TS, as drones send by UDP."""
    content = io.BytesIO()
    with av.open(content, "w", format="mpegts") as container:
        stream: Any = container.add_stream(codec, rate=30)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for number, data in encoded(codec):
            packet = Packet(data)
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            packet.pts = packet.dts = number
            container.mux(packet)
    return content.getvalue()


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
@pytest.mark.parametrize("lost", [1, 10, 200])
def test_lost_datagrams_of_a_transport_stream_smear_nothing(codec: str, lost: int) -> None:
    """Its packets are numbered, so that damage within a frame of H.265 is known, too."""
    size, whole = 188, _transport_stream(codec)
    begin = len(whole) // size // 3 * size
    spoilt = io.BytesIO(whole[:begin] + whole[begin + lost * size :])
    numbers = []
    with av.open(spoilt, options={"fpsprobesize": "0"}) as container:
        stream = container.streams.video[0]
        decoder, first = FrameDecoder(stream.codec_context), None
        for packet in container.demux(stream):
            for picture in decoder.decode(packet):
                time_of = float(picture.time or 0.0)
                first = time_of if first is None else first
                numbers.append(round(30.0 * (time_of - first)))
                assert error(bgr_image(picture), numbers[-1]) < SMEARED
    assert numbers[:10] == [*range(10)]
    assert numbers[-1] == COUNT - 1
    assert len(numbers) <= COUNT - 10
