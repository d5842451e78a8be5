"""Started by test_mavsdk.py, with a Python that has MAVSDK: `mavsdk_payload_client.py PORT`."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.camera import Camera
from mavsdk.plugins.gimbal import ControlMode, Gimbal, GimbalMode, SendMode

_LONGEST = 25.0
"""Seconds; MAVSDK asks for a card's room every 20."""


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _LONGEST
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.1)


def _film(camera: Camera, seen: dict[str, Any]) -> None:
    pictures: list[Any] = []
    storages: list[Any] = []
    streams: list[Any] = []
    camera.subscribe_capture_info(lambda said, *_: pictures.append(said))
    camera.subscribe_storage(lambda said, *_: storages.append(said))
    camera.subscribe_video_stream_info(lambda said, *_: streams.append(said))
    _until(lambda: bool(camera.camera_list().cameras))
    (known,) = camera.camera_list().cameras
    number = known.component_id
    seen["camera"] = [number, known.vendor_name, known.horizontal_resolution_px]
    seen["focal length"] = known.focal_length_mm
    camera.take_photo(number)
    _until(lambda: bool(pictures))
    seen["pictures"] = [[one.is_success, one.index, one.file_url] for one in pictures]
    seen["pitch of it"] = pictures[0].attitude_euler_angle.pitch_deg
    camera.zoom_range(number, 40.0)
    camera.focus_range(number, 60.0)
    _until(lambda: bool(storages and streams))
    seen["free"] = [one.storage.available_storage_mib for one in storages[-1:]]
    seen["video"] = [one.video_stream_info.settings.uri for one in streams[-1:]]


def _turn(gimbal: Gimbal, seen: dict[str, Any]) -> None:
    _until(lambda: bool(gimbal.gimbal_list().gimbals))
    (known,) = gimbal.gimbal_list().gimbals
    number = known.gimbal_id
    seen["gimbal"] = [known.gimbal_device_id, known.model_name]

    def pitch() -> float:
        angle: float = gimbal.get_attitude(number).euler_angle_forward.pitch_deg
        return angle

    gimbal.take_control(number, ControlMode.PRIMARY)
    gimbal.set_angles(number, 0.0, -40.0, 20.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
    _until(lambda: math.isclose(pitch(), -40.0, abs_tol=0.5))
    angles = gimbal.get_attitude(number).euler_angle_forward
    seen["looks"] = [angles.roll_deg, angles.pitch_deg, angles.yaw_deg]
    _until(lambda: gimbal.get_control_status(number).control_mode == ControlMode.PRIMARY)
    seen["in control"] = gimbal.get_control_status(number).control_mode == ControlMode.PRIMARY


def main() -> None:
    """Find a camera and a gimbal, use them; print what was seen as JSON."""
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
    system = sdk.first_autopilot(15.0)
    seen: dict[str, Any] = {}
    _turn(Gimbal(system), seen)
    _film(Camera(system), seen)
    sys.stdout.write(json.dumps(seen) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
