"""An executor of the cloud by itself: frames that are carried, named, late or unknown."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from typing import Any, ClassVar

import numpy as np
import pytest

from aerodaas import Analytics, Frame
from aerodaas.actors.dispatch.executor import (
    FRAMES_KEPT,
    CloudExecutor,
    Executed,
    MissingFrameError,
    UnpreparedError,
)
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.analytics.base import Context
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.runtime.dispatch.frame_codec import Codec

pytestmark = pytest.mark.wall_clock

FRAME = Frame(Header(7, 70, "camera"), np.full((8, 8, 3), 200, np.uint8))


class Shade(Analytics[float]):
    """Says how bright a picture is."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = float
    concurrent = True

    def process(self, item: Frame, context: Context) -> float:  # noqa: ARG002
        """Take the mean."""
        return float(item.image.mean())


def encoded(item: object = FRAME) -> bytes:
    """The message of a frame."""
    message: Message[Any] = Message("camera", 7, 70, FRAME.header, 3, (), item)
    return encode_message(message)


def result(executed: Executed) -> float:
    """What the analysis said."""
    message: Message[float] = decode_message(memoryview(executed.message))
    assert message.item is not None
    return message.item


@pytest.fixture
def executor() -> CloudExecutor:
    """One that is prepared."""
    made = CloudExecutor()
    made.prepare(ProcessVariables({}), {"one": Shade(), "two": Shade()})
    return made


def test_a_frame_is_carried_once_and_then_named(executor: CloudExecutor) -> None:
    """The second analysis gets the picture as it was unpacked for the first."""
    coded = encoded(Codec("jpeg").encoded(FRAME))
    first = executor.execute("one", ("camera", 7), coded)
    second = executor.execute("two", ("camera", 7), b"")
    assert result(first) == result(second) == pytest.approx(200, abs=2)
    assert first.decoding > 0
    assert second.decoding == 0
    spans = decode_message(memoryview(second.message)).spans
    assert [span.node for span in spans] == ["two"], "not what was done for the other"


def test_a_call_that_names_a_frame_waits_for_the_thread_that_unpacks_it(
    executor: CloudExecutor,
) -> None:
    """Calls begin in order, but threads take turns as they like."""
    found: list[float] = []

    def name() -> None:
        found.append(result(executor.execute("two", ("camera", 7), b"")))

    thread = threading.Thread(target=name)
    thread.start()
    time.sleep(0.05)
    assert not found
    executor.execute("one", ("camera", 7), encoded())
    thread.join(10.0)
    assert found == [200.0]


def test_of_frames_the_newest_are_kept(
    executor: CloudExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The oldest gives way; who names it, or one that never came, is told so."""
    monkeypatch.setattr("aerodaas.actors.dispatch.executor._UNPACKING", 0.0)
    for number in range(FRAMES_KEPT + 1):
        executor.execute("one", ("camera", number), encoded())
    executor.execute("one", ("camera", 1), b"")
    for unknown in (("camera", 0), ("another", 1)):
        with pytest.raises(MissingFrameError, match="lacks the frame"):
            executor.execute("one", unknown, b"")


def test_an_executor_that_was_restarted_holds_nothing() -> None:
    """Whatever it is asked."""
    with pytest.raises(UnpreparedError, match="restarted"):
        CloudExecutor().execute("one", ("camera", 7), encoded())


def test_the_first_frame_waits_for_no_library() -> None:
    """Whoever times the coding of frames has loaded what codes them."""
    code = (
        "import sys\n"
        "from aerodaas.runtime.dispatch.frame_codec import Codec\n"
        "from aerodaas.actors.dispatch.frame_uplink import FrameUplink\n"
        "assert 'cv2' not in sys.modules\n"
        "FrameUplink(Codec())\n"
        "assert 'cv2' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
