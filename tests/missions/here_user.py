"""The user's side of a flight in a process of its own: compiles an application, and serves it.

Its arguments are the application's file, the socket of the flight, and how it is to misbehave.
"""

from __future__ import annotations

import os
import runpy
import socket
import sys
import time
from pathlib import Path
from typing import Any

from aerodaas.analytics.here.relay import Channel, ChannelError
from aerodaas.config.options import RunOptions, current_options
from aerodaas.environment.document.compiling import write_mission
from aerodaas.environment.offering import offered, the_only
from aerodaas.environment.provider.here import HereServer

_LATER = 60
"""Answers after which it misbehaves, in the air."""


def main() -> None:
    """Serve until the flight closes the connection."""
    application, place, how = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    current_options.set(RunOptions(application=application, view=False))
    with offered() as found:
        runpy.run_path(str(application), run_name="__main__")
    environment = the_only(found)
    document = write_mission(environment, application.stem, here=True)
    server = HereServer(environment, document)
    server.open()
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.connect(place)
    channel = Channel(connection)
    channel.send({"document": document.model_dump(mode="json")})
    count = 0
    while True:
        try:
            request, blob = channel.receive()
        except ChannelError:
            break
        answer, rest = server.answer(request, blob)
        count += 1
        if count > _LATER:
            answer, rest = misbehave(how, answer)
        channel.send(answer, rest)
    server.close()


def misbehave(how: str, answer: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
    """What is sent instead of an answer."""
    if how == "killed":
        os._exit(1)
    if how == "hung":
        time.sleep(600)
    if how == "slow":
        time.sleep(0.3)
    if how == "oversize":
        answer["item"] = "x" * (2 << 20)
    if how == "malformed":
        answer["item"] = {"is": "Waypoint", "of": {"id": 5}}
    if how == "wrong":
        answer["item"] = "a text"
    if how == "blob":
        return answer, b"more"
    return answer, b""


if __name__ == "__main__":
    main()
