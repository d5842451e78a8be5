"""Run a djitellopy program on an emulated Tello of this host: _tello_here.py PORT SCRIPT ARGUMENTS.

The library knows one drone's fixed address and ports, which on one host are the emulator's own.
"""

from __future__ import annotations

import runpy
import sys
import time
from pathlib import Path

import djitellopy
from _ports import free_port

PORT = int(sys.argv[1])
STATE, VIDEO = free_port(), free_port()


class Tello(djitellopy.Tello):  # type: ignore[misc]
    """The library's, which knows where the emulated one listens."""

    def __init__(self) -> None:
        super().__init__("127.0.0.1", vs_udp=VIDEO)
        self.address = ("127.0.0.1", PORT)

    def connect(self, wait_for_state: bool = True) -> None:  # noqa: FBT001, FBT002 - the library's
        """Connect, and move its packets to free ports."""
        super().connect(wait_for_state=False)
        self.set_network_ports(STATE, VIDEO)
        while wait_for_state and not self.get_current_state():
            time.sleep(0.1)


djitellopy.Tello.CONTROL_UDP_PORT, djitellopy.Tello.STATE_UDP_PORT = free_port(), STATE
djitellopy.Tello.FRAME_GRAB_TIMEOUT = 60  # seconds: a busy machine films slowly
djitellopy.Tello = Tello
sys.argv = sys.argv[2:]
sys.path.insert(0, str(Path(sys.argv[0]).parent))
runpy.run_path(sys.argv[0], run_name="__main__")
