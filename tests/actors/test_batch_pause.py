"""A reader that pauses between batches finds room left in each queue."""

from __future__ import annotations

import pytest

from aerodaas.actors.recorder import BatchPause

_LONGEST = 0.1


@pytest.mark.parametrize("rate", [1, 20, 100, 300, 1000, 5000])
@pytest.mark.parametrize("depth", [8, 32])
def test_a_stream_of_any_rate_fits_into_its_queue(rate: int, depth: int) -> None:
    """Slow ones are taken each tenth of a second, fast ones before the queue is full."""
    pause = BatchPause(_LONGEST)
    read = [0]
    now = wait = 0.0
    waits = []
    for _ in range(1000):
        now += wait + 1e-4
        count = int(now * rate) - read[-1]
        read.append(read[-1] + count)
        assert count < depth
        wait = pause.after({"stream": count} if count else {}, {"stream": depth})
        waits.append(wait)
    assert max(waits) <= _LONGEST
    if rate * _LONGEST < depth // 4:
        assert waits[-1] == _LONGEST


def test_one_stream_of_many_that_fills_its_queue_shortens_the_pause() -> None:
    """The others' queues do not make up for it."""
    pause = BatchPause(_LONGEST)
    depths = {"slow": 32, "camera": 8}
    before = [pause.after({"slow": 1}, depths) for _ in range(50)][-1]
    assert pause.after({"slow": 1, "camera": 3}, depths) < before / 2


def test_no_pause_is_none() -> None:
    """As for a live view."""
    pause = BatchPause(0.0)
    assert not any(pause.after({"slow": 1}, {"slow": 32}) for _ in range(3))
