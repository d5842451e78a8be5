"""What publishers and subscribers of one node say to each other.

A connection has two sockets, both of whole packets (`SOCK_SEQPACKET`), in order and reliable:

- the queue, on which messages go to the reader. The publisher keeps both its ends: from the far one
  it takes the oldest message back, if the reader has not, when the queue is full. The kernel gives
  each packet to one of them.
- the control connection, which ends when either process does. The publisher first sends the name
  of the stream with the far end of the queue, the page and the bell that tell which messages are
  complete, and the file of its slots before it first uses one; the reader gives slots back.

A packet of the queue is a message, or a slot, and a trailer with its number from 1 on.
"""

from __future__ import annotations

import array
import fcntl
import os
import socket
import struct
import sys
import termios

__all__ = [
    "INLINE",
    "IN_SLOT",
    "LEAVING",
    "LONGEST",
    "LONGEST_INLINE",
    "RELEASE",
    "SLOT",
    "TRAILER",
    "packet",
    "queue",
    "receive_descriptors",
    "send_descriptors",
    "waiting_bytes",
]

LONGEST_INLINE = 3072
"""Bytes up to which a message travels in its packet: the kernel takes 4 KiB for it, and 32 of them
fit into a socket's buffer of the usual 208 KiB."""
TRAILER = struct.Struct("<QB")
"""Number of a message, and where it is: `INLINE` or `IN_SLOT`."""
INLINE, IN_SLOT = 0, 1
SLOT = struct.Struct("<QQQ")
"""Offset and capacity of a slot, size of the message in it."""
LONGEST = LONGEST_INLINE + 64
RELEASE = struct.Struct("<Q")
"""Offset of a slot that the reader no longer holds."""
LEAVING = 2**64 - 1
"""In place of an offset: the reader reads no more, and gives back later what it holds."""
_LONGEST_NAME = 1024


def queue() -> tuple[socket.socket, socket.socket]:
    """Return the near and the far end of a new queue. Raises OSError without descriptors."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)


def waiting_bytes(far: socket.socket) -> int:
    """Return how many bytes of a queue have not been read at its far end."""
    count = bytearray(4)
    fcntl.ioctl(far, termios.FIONREAD, count)
    return int.from_bytes(count, sys.byteorder)


def packet(connection: socket.socket, longest: int) -> bytes | None:
    """Return the next packet, empty at the connection's end; None if there is none yet.

    Args:
        connection: A socket of packets.
        longest: Most bytes of a packet.
    """
    try:
        return connection.recv(longest, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return None
    except OSError:  # reset by the other end
        return b""


def send_descriptors(connection: socket.socket, name: str, *descriptors: int) -> None:
    """Send open files or sockets.

    Args:
        connection: A Unix socket.
        name: What they are called.
        *descriptors: The descriptors.

    Raises:
        OSError: If the other end is gone or takes no more.
    """
    rights = array.array("i", descriptors)
    connection.sendmsg(
        [name.encode()], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, rights)], socket.MSG_NOSIGNAL
    )


def receive_descriptors(connection: socket.socket, count: int) -> tuple[str, list[int]] | None:
    """Return `count` open descriptors that were sent, and their name; None for anything else.

    Args:
        connection: A Unix socket.
        count: How many descriptors are expected.
    """
    try:
        name, descriptors, _, _ = socket.recv_fds(
            connection, _LONGEST_NAME, count + 1, socket.MSG_CMSG_CLOEXEC
        )
    except OSError:
        return None
    if len(descriptors) != count:
        for one in descriptors:
            os.close(one)
        return None
    return name.decode(errors="replace"), list(descriptors)
