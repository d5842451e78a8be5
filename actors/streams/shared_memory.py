"""Shared memory transport over iceoryx2: publish-subscribe and event services of one stream.

Only this module uses iceoryx2, whose Python API is young; the version is pinned in
pyproject.toml. A publisher writes a message once into shared memory, a reader maps it without a
copy, and a full reader loses its oldest message (safe overflow), never the newest.

Each user of the machine has a folder and names of their own for it: the folder that iceoryx2 makes
in `/tmp` by itself locks all users out but the first.
"""

from __future__ import annotations

import ctypes
import functools
import importlib
import os
import weakref
from pathlib import Path
from typing import Any

from aerodaas.actors.private_folder import shared_memory_names
from aerodaas.actors.streams.codec import Encoded, decode
from aerodaas.types.errors import AeroDaaSError
from aerodaas.types.status import Message

__all__ = [
    "SharedPublisher",
    "SharedSubscriber",
    "SharedWaiter",
    "shared_memory_available",
    "shared_memory_obstacle",
]

MAX_READERS = 16
MAX_DEPTH = 32
"""Largest queue depth of a reader."""
MAX_BORROWED = 16
"""Most messages that a reader may hold while it receives further ones."""
_INITIAL_BYTES = 4096
_COPIED_BYTES = 65536
"""Messages up to this size are copied, in microseconds, so that readers need not borrow them."""


@functools.cache
def _iceoryx() -> Any:  # noqa: ANN401 - the library ships no types
    iceoryx2: Any = importlib.import_module("iceoryx2")  # only if a stream is opened
    iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)
    return iceoryx2


def shared_memory_available() -> bool:
    """Return whether this process can use streams in shared memory."""
    return not shared_memory_obstacle()


@functools.cache
def shared_memory_obstacle() -> str:
    """Return why this process cannot use streams in shared memory; empty if it can."""
    try:
        _node()
    except ImportError:
        return (
            "iceoryx2 is missing: pip install 'iceoryx2==0.10.*', which builds it with Rust where "
            "it has no wheel"
        )
    except AeroDaaSError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001 - the library's errors have no common base
        return f"iceoryx2 does not start: {type(error).__name__} {error}"
    return ""


@functools.cache
def _node() -> Any:  # noqa: ANN401
    """One iceoryx2 node for each process."""
    iox = _iceoryx()
    config = iox.config.default()
    folder, prefix = shared_memory_names()
    config.global_cfg.root_path = iox.Path.new(str(folder))
    config.global_cfg.prefix = iox.FileName.new(prefix)
    builder = iox.NodeBuilder.new().config(config)
    builder = builder.signal_handling_mode(iox.SignalHandlingMode.Disabled)
    node = builder.create(iox.ServiceType.Ipc)
    _close_counter(prefix)
    return node


def _close_counter(prefix: str) -> None:
    """Close iceoryx2's counter of nodes to other users, to whom it opens it.

    A user who may write to it can end our processes: they map it, and it could be cut short.
    Raises AeroDaaSError if another user made it.
    """
    for path in Path("/dev/shm").glob(f"{prefix}*.global_mgmt"):  # noqa: S108 - where the kernel has it
        owner = path.stat().st_uid
        if owner != os.geteuid():
            raise AeroDaaSError(
                f"{path} is a file of user {owner}, not of our own, and is not used; remove it: "
                f"sudo rm {path}"
            )
        path.chmod(0o600)


@functools.lru_cache(maxsize=512)
def _services(name: str) -> tuple[Any, Any]:
    iox = _iceoryx()
    data = (
        _node()
        .service_builder(iox.ServiceName.new(name))
        .publish_subscribe(iox.Slice[ctypes.c_uint8])
        .enable_safe_overflow(True)  # noqa: FBT003 - the library's own signature
        .max_publishers(2)
        .max_subscribers(MAX_READERS)
        .max_nodes(MAX_READERS + 2)
        .subscriber_max_buffer_size(MAX_DEPTH)
        .subscriber_max_borrowed_samples(MAX_BORROWED)
        .history_size(0)
        .open_or_create()
    )
    event = _event(name, notifiers=4)
    return data, event


def _event(name: str, notifiers: int) -> Any:  # noqa: ANN401
    iox = _iceoryx()
    return (
        _node()
        .service_builder(iox.ServiceName.new(name))
        .event()
        .max_listeners(MAX_READERS)
        .max_notifiers(notifiers)
        .max_nodes(MAX_READERS + notifiers)
        .open_or_create()
    )


class SharedPublisher:
    """Publisher of one stream in shared memory."""

    def __init__(self, name: str) -> None:
        """Open the stream `name` for writing."""
        iox = _iceoryx()
        data, event = _services(name)
        self._publisher = (
            data.publisher_builder()
            .initial_max_slice_len(_INITIAL_BYTES)
            .allocation_strategy(iox.AllocationStrategy.PowerOfTwo)
            .create()
        )
        # The library keeps slots for all messages that its readers may hold; memory is touched
        # only when used. With fewer slots, a slow reader would abort this process.
        self._notifier = event.notifier_builder().create()
        self.refused = 0
        """Number of messages not sent for lack of memory."""

    def send(self, encoded: Encoded) -> None:
        """Write a message and wake the readers."""
        try:
            sample = self._publisher.loan_slice_uninit(encoded.size)
        except Exception:  # noqa: BLE001 - LoanError has no stable import path
            self.refused += 1
            return
        address = sample.payload().data_ptr
        block = (ctypes.c_uint8 * encoded.size).from_address(address)
        encoded.write_into(memoryview(block).cast("B"))
        sample.assume_init().send()
        self._notifier.notify()

    def close(self) -> None:
        """Close the stream."""
        self._publisher.delete()
        self._notifier.delete()


class _Loan:
    """A message that its reader still holds."""

    __slots__ = ("__weakref__", "_sample")

    def __init__(self, sample: Any) -> None:  # noqa: ANN401
        self._sample = sample


class SharedSubscriber:
    """Subscriber of one stream in shared memory."""

    def __init__(self, name: str, depth: int) -> None:
        """Open the stream `name`, keeping the newest `depth` messages."""
        data, event = _services(name)
        self._subscriber = data.subscriber_builder().buffer_size(depth).create()
        self.listener = event.listener_builder().create()
        self._loans: weakref.WeakSet[_Loan] = weakref.WeakSet()

    def receive(self) -> Message[Any] | None:
        """Return the oldest queued message, or None.

        Its large arrays are in shared memory, or copied if the reader already holds too many
        messages to receive another. Raises UnreadableError if its item cannot be rebuilt here.
        """
        try:
            sample = self._subscriber.receive()
        except Exception:  # noqa: BLE001 - ReceiveError has no stable import path
            # A publisher died while sending; its readers must continue.
            return None
        if sample is None:
            return None
        payload = sample.payload()
        size = payload.number_of_elements
        block = (ctypes.c_uint8 * size).from_address(payload.data_ptr)
        if size <= _COPIED_BYTES or len(self._loans) >= MAX_BORROWED - 1:
            return decode(memoryview(bytes(block)))
        # The views that decode makes keep `block` alive, and `block` keeps the sample borrowed.
        loan = _Loan(sample)
        self._loans.add(loan)
        block._loan = loan  # noqa: SLF001
        return decode(memoryview(block).cast("B"))

    def close(self) -> None:
        """Close the stream."""
        self._subscriber.delete()
        self.listener.delete()


class SharedWaiter:
    """Waits for a message on one of several streams, or for a wake-up by another thread."""

    def __init__(self, name: str) -> None:
        """Create the wait set; `name` of its event is unique in the process."""
        iox = _iceoryx()
        self._microseconds = iox.Duration.from_micros
        builder = iox.WaitSetBuilder.new().signal_handling_mode(iox.SignalHandlingMode.Disabled)
        self._set = builder.create(iox.ServiceType.Ipc)
        call = _event(name, notifiers=2)
        self._listener = call.listener_builder().create()
        self._notifier = call.notifier_builder().create()
        self._listeners = [self._listener]
        self._guards = [self._set.attach_notification(self._listener)]

    def attach(self, subscriber: SharedSubscriber) -> None:
        """Add a stream that ends the wait."""
        self._listeners.append(subscriber.listener)
        self._guards.append(self._set.attach_notification(subscriber.listener))

    def wait(self, timeout: float) -> None:
        """Wait up to `timeout` seconds, without holding the interpreter lock."""
        self._set.wait_and_process_with_timeout(self._microseconds(max(1, int(timeout * 1e6))))
        for listener in self._listeners:
            listener.try_wait()  # takes all that have arrived

    def wake(self) -> None:
        """End the wait from another thread."""
        self._notifier.notify()

    def close(self) -> None:
        """Release the wait set."""
        for guard in self._guards:
            guard.delete()
        self._set.delete()
        self._listener.delete()
        self._notifier.delete()
