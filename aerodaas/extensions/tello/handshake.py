"""Handshake with a Tello, and the diagnosis when it does not answer."""

from __future__ import annotations

import queue
import time

from aerodaas.errors import VehicleError
from aerodaas.extensions.tello.commands import ENTER, STREAM_ON, VERSION, Command, ports
from aerodaas.extensions.tello.link import TelloLink
from aerodaas.extensions.tello.settings import STATE_PORT, VIDEO_PORT, TelloSettings

__all__ = ["explain_no_states", "greet", "meaning"]

_MEANINGS = {
    "motor stop": "the battery is low, a propeller is blocked, or it was tilted: charge it, look",
    "no valid imu": "it cannot see the ground: give it light and a floor with a pattern, or "
    "calibrate it in the Tello app",
    "not joystick": "it cannot do this in the air as things stand",
    "auto land": "it is landing by itself: low battery, heat, or 15 s without a command",
    "out of range": "beyond the ranges of the SDK",
    "unknown command": "its firmware does not know it: update it in the Tello app",
}

_REFUSALS = 2


def meaning(reply: str) -> str:
    """Meaning of refusals whose texts are known from reports of users."""
    for words, text in _MEANINGS.items():
        if words in reply.lower():
            return text
    return "it gives no reason; battery, heat and level ground are the usual ones"


def greet(
    link: TelloLink,
    name: str,
    settings: TelloSettings,
    video_port: int | None,
    deadline: float,
) -> None:
    """Enter SDK mode, set ports that are not the default ones, switch the video on.

    Args:
        link: The link to the Tello.
        name: Id of the robot, for errors.
        settings: Ports of this host.
        video_port: Port for video; None leaves the video off.
        deadline: Monotonic seconds by which it returns or raises.

    Raises:
        VehicleError: If the Tello does not answer, or refuses.
    """
    if _ask(link, ENTER, deadline) is None:
        raise VehicleError(_explain_silence(link, name, settings))
    video = VIDEO_PORT if video_port is None else video_port
    if (settings.state_port, video) != (STATE_PORT, VIDEO_PORT):
        reply = _ask(link, ports(settings.state_port, video), deadline)
        if reply is None or not Command.succeeded(reply):
            version = _ask(link, VERSION, deadline) or "unknown"
            raise VehicleError(
                f"{name}: the Tello answered {reply!r} when told to send to the ports "
                f"{settings.state_port} and {video}: this needs SDK 3.0, and it has version "
                f'{version}. Use the default ports, and "local_address" or "interface" to tell '
                "several Tellos apart"
            )
    if video_port is not None:
        reply = _ask(link, STREAM_ON, deadline)
        if reply is None or not Command.succeeded(reply):
            answer = "did not answer" if reply is None else f"answered {reply!r}"
            raise VehicleError(f"{name}: the Tello {answer} when told to send video")


def _ask(link: TelloLink, command: Command, deadline: float) -> str | None:
    """The reply to `command`; None after the timeout.

    Only `command` itself is repeated until the timeout; also after a refusal, as the request or
    the reply may have been garbled.
    """
    answers: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    reply, refusals = None, 0
    while (left := deadline - time.monotonic()) > 0.0 and refusals < _REFUSALS:
        link.request(command, answers.put)
        try:
            reply = answers.get(timeout=left)
        except queue.Empty:
            return None
        if reply is not None and Command.succeeded(reply):
            break
        refusals += reply is not None or command is not ENTER
    return reply


def _explain_silence(link: TelloLink, name: str, settings: TelloSettings) -> str:
    if link.failure is not None:
        return (
            f"{name}: nothing can be sent to {settings.address}: {link.failure.strerror}; "
            "join the Tello's Wi-Fi (TELLO-…), or set its address"
        )
    if link.counts.strangers:
        return (
            f"{name}: {settings.address} does not answer, but {link.counts.strangers} packets came "
            "from elsewhere: set the Tello's address"
        )
    return (
        f"{name}: no answer from {settings.address}:{settings.command_port}; is the Tello switched "
        "on (light flashing yellow), this host in its Wi-Fi (TELLO-…), no other program or phone "
        f"connected to it, and the firewall open for replies (`ping {settings.address}`)?"
    )


def explain_no_states(link: TelloLink, name: str, settings: TelloSettings) -> str:
    """Reason why no state packet arrives although the Tello replies to commands.

    Args:
        link: The link to the Tello.
        name: Id of the robot, for the text.
        settings: The port for states.
    """
    port, counts = settings.state_port, link.counts
    if counts.malformed:
        return (
            f"{name}: {counts.malformed} packets came to UDP port {port}, none of which is a "
            "state packet of a Tello; update its firmware in the Tello app"
        )
    elsewhere = f" ({counts.strangers} came from elsewhere)" if counts.strangers else ""
    return (
        f"{name}: the Tello answers but no state packet came to UDP port {port}{elsewhere}; open "
        f"the firewall (`sudo ufw allow {port}/udp`), and end other programs that use a Tello"
    )
