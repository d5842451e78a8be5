"""Run by the Python of an environment with djitellopy: fly an emulated Tello, print what came."""

from __future__ import annotations

import json
import sys
import time

from djitellopy import Tello, TelloException


def main() -> None:
    """Fly; the arguments are the emulator's port and three free ones of this host."""
    port, own, state, video = map(int, sys.argv[1:])
    # The library knows no other ports than the default ones: these are its class's constants.
    Tello.CONTROL_UDP_PORT, Tello.STATE_UDP_PORT = own, state
    tello = Tello("127.0.0.1", retry_count=1, vs_udp=video)
    tello.address = ("127.0.0.1", port)
    seen: dict[str, object] = {}
    tello.connect(wait_for_state=False)
    tello.set_network_ports(state, video)
    time.sleep(0.5)
    seen["battery"] = tello.get_battery()
    seen["sdk"] = tello.query_sdk_version()
    tello.streamon()
    reader = tello.get_frame_read()
    tello.takeoff()
    seen["height"] = tello.get_height()
    tello.move_forward(60)
    tello.rotate_counter_clockwise(90)
    seen["yaw"] = tello.get_yaw()
    tello.go_xyz_speed(50, 0, 30, 60)
    try:
        tello.move_up(10)
    except TelloException as error:
        seen["refusal"] = str(error)
    for _ in range(30):
        tello.send_rc_control(0, 50, 0, 0)
        time.sleep(0.05)
    seen["speed"] = [tello.get_speed_x(), tello.get_speed_y()]
    tello.send_rc_control(0, 0, 0, 0)
    frame = reader.frame
    seen["frame"] = [*frame.shape, float(frame.std())]
    tello.land()
    seen["landed"] = tello.get_height()
    tello.streamoff()
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
