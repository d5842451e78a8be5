"""Pictures that a camera draws where their readers look at them."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from publishing import send

from aerodaas.actors.streams import Publisher, Subscriber
from aerodaas.cameras.base import PlacingCamera
from aerodaas.cameras.simulated import SimulatedCamera
from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry

_HEIGHT, _WIDTH = 180, 320


class _Link:
    """A publisher, and a reader that keeps what it reads if asked."""

    def __init__(self) -> None:
        scope = f"test/{uuid.uuid4().hex[:8]}"
        self.publisher = Publisher(scope, "s")
        self.reader = Subscriber(scope, {"s": 4})
        self._stamp = 0
        self.publish(None)  # from here on the publisher knows its reader
        assert self.read() is None

    def draw(self, value: int, height: int = _HEIGHT) -> NDArray[np.uint8]:
        """Return a picture of one value, drawn into the publisher's memory."""
        image = self.publisher.picture_memory(height, _WIDTH)
        image[...] = value
        return image

    def publish(self, image: NDArray[np.uint8] | None, *, depth: bool = False) -> None:
        """Publish a picture, or nothing."""
        header = Header(self._stamp, self._stamp, "c")
        measured = np.full(image.shape[:2], 7, np.uint16) if image is not None and depth else None
        frame = None if image is None else Frame(header, image, depth=measured)
        send(self.publisher, frame, header, 0)
        self._stamp += 1

    def read(self) -> Frame | None:
        """Return the newest item."""
        item: Frame | None = self.reader.receive(0)[-1].item
        return item


@pytest.fixture
def link() -> Iterator[_Link]:
    """A publisher and its reader."""
    made = _Link()
    yield made
    made.reader.close()
    made.publisher.close()


def _is(frame: Frame | None, value: int, shape: tuple[int, int] = (_HEIGHT, _WIDTH)) -> bool:
    assert frame is not None
    return frame.image.shape == (*shape, 3) and bool((frame.image == value).all())


@pytest.mark.parametrize("depth", [False, True])
def test_a_picture_drawn_in_place_is_not_copied(link: _Link, depth: bool) -> None:  # noqa: FBT001
    """The reader sees the memory in which it was drawn; there is room for its depth."""
    image = link.draw(5)
    link.publish(image, depth=depth)
    frame = link.read()
    assert _is(frame, 5)
    image[0, 0, 0] = 99  # what a camera must not do shows that it is one memory
    assert frame is not None
    assert frame.image[0, 0, 0] == 99


@pytest.mark.parametrize("depth", [False, True])
def test_pictures_that_a_reader_keeps_stay_as_they_were(link: _Link, depth: bool) -> None:  # noqa: FBT001
    """Memory is used again only when nobody reads it any more; depth travels beside."""
    kept = []
    for value in range(40):
        link.publish(link.draw(value), depth=depth)
        kept.append(link.read())
    for value, frame in enumerate(kept):
        assert _is(frame, value)
        assert frame is not None
        assert (frame.depth is None) is not depth
        assert not depth or bool((np.asarray(frame.depth) == 7).all())


def test_a_picture_that_was_not_published_leaves_no_trace(link: _Link) -> None:
    """A camera may find that it has none after all; the memory is used for the next."""
    assert _places(link.draw(value) for value in range(20)) == 1
    link.publish(link.draw(9))
    assert _is(link.read(), 9)


def _places(pictures: Iterable[NDArray[np.uint8]]) -> int:
    return len({picture.__array_interface__["data"][0] for picture in pictures})


def _lower_half(link: _Link) -> NDArray[np.uint8]:
    image = link.draw(1)
    image[_HEIGHT // 2 :] = 2
    return image[_HEIGHT // 2 :]


def _own(link: _Link) -> NDArray[np.uint8]:
    link.draw(1)
    return np.full((_HEIGHT // 2, _WIDTH, 3), 2, np.uint8)


def _upper_half(link: _Link) -> NDArray[np.uint8]:
    image = link.draw(1)
    image[: _HEIGHT // 2] = 2
    return image[: _HEIGHT // 2]


def _turned(link: _Link) -> NDArray[np.uint8]:
    image = link.draw(1, _HEIGHT // 2)
    image[...] = 2
    return image[::-1]


@pytest.mark.parametrize("drawn", [_lower_half, _upper_half, _own, _turned])
def test_what_is_not_the_whole_memory_arrives(
    link: _Link, drawn: Callable[[_Link], NDArray[np.uint8]]
) -> None:
    """A part of it, a picture of one's own, and one that is not contiguous, as they are."""
    places: list[NDArray[np.uint8]] = []
    for _ in range(20):
        link.publish(drawn(link))
        assert _is(link.read(), 2, (_HEIGHT // 2, _WIDTH))
        places.append(link.draw(0))
    assert _places(places) <= 3  # what was lent is lent again


def test_what_has_no_room_beside_the_picture_is_written_elsewhere(link: _Link) -> None:
    """An item may hold far more than the picture that was asked for."""
    image = link.draw(4)
    send(link.publisher, [image, np.ones(5_000_000, np.uint8)], Header(9, 9, "c"), 0)
    picture, more = link.reader.receive(0)[-1].item or (None, None)
    assert (np.asarray(picture) == 4).all()
    assert np.asarray(more).sum() == 5_000_000


def test_without_readers_memory_is_the_cameras_own() -> None:
    """Nobody's slots are filled for nobody."""
    publisher = Publisher(f"test/{uuid.uuid4().hex[:8]}", "s")
    first, second = publisher.picture_memory(4, 6), publisher.picture_memory(4, 6)
    assert first.shape == (4, 6, 3)
    assert not np.shares_memory(first, second)
    publisher.close()


def test_the_simulated_camera_draws_in_place() -> None:
    """Into the memory that it is given, the same picture as into its own."""
    environment = EnvironmentConfig.model_validate(
        {"robots": [{"id": "d", "sensors": [{"id": "c", "type": "camera"}]}]}
    )
    camera = SimulatedCamera(environment.robots[0].sensors[0], environment)
    assert isinstance(camera, PlacingCamera)
    camera.open()
    pose = Odometry(np.array([0.0, 0.0, 2.0]), np.zeros(3), 0.3)
    own = camera.capture(0, pose)
    given: list[NDArray[np.uint8]] = []

    def memory(height: int, width: int) -> NDArray[np.uint8]:
        given.append(np.zeros((height, width, 3), np.uint8))
        return given[-1]

    camera.place_in(memory)
    placed = camera.capture(0, pose)
    camera.close()
    assert own is not None
    assert placed is not None
    assert placed.image is given[0]
    np.testing.assert_array_equal(placed.image, own.image)
