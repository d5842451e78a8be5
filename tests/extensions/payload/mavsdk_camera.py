"""A camera by MAVSDK, until its standard input ends: `mavsdk_camera.py PORT SYSTEM COMPONENT`.

What it was told to do is printed, a JSON list a line. Started with a Python that has MAVSDK.
"""

from __future__ import annotations

import json
import queue
import sys
import threading
from collections.abc import Callable
from typing import Any

from mavsdk import Configuration, Mavsdk
from mavsdk.plugins.camera_server import camera_server as served

_OK = served.CameraFeedback.OK


def main() -> None:
    """Be a camera of 4000 x 3000 pixels with 5,000 MiB of room, and a lens that can be set."""
    port, system, component = sys.argv[1:]
    sdk = Mavsdk(
        Configuration.create_manual(int(system), int(component), always_send_heartbeats=True)
    )
    sdk.add_any_connection(f"udpout://127.0.0.1:{port}")
    camera = served.CameraServer(sdk.server_component())
    orders: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()

    def take(name: str) -> Callable[[Any, Any], None]:
        return lambda value, _: orders.put((name, value))

    camera.set_information(
        served.Information(
            vendor_name="MAVSDK",
            model_name="Camera Server",
            firmware_version="4.1.0",
            focal_length_mm=8.8,
            horizontal_sensor_size_mm=13.2,
            vertical_sensor_size_mm=8.8,
            horizontal_resolution_px=4000,
            vertical_resolution_px=3000,
        )
    )
    camera.set_in_progress(False)
    camera.subscribe_take_photo(take("photo"))
    camera.subscribe_zoom_range(take("zoom"))
    camera.subscribe_focus_range(take("focus"))
    camera.subscribe_capture_status(take("status"))
    camera.subscribe_storage_information(take("storage"))
    threading.Thread(target=lambda: orders.put(("end", sys.stdin.read())), daemon=True).start()
    taken = 0
    while True:
        name, value = orders.get()
        if name == "end":
            return
        if name == "photo":
            place = served.Position(47.4, 8.5, 500.0, 12.0)
            level = served.Quaternion(1.0, 0.0, 0.0, 0.0)
            picture = served.CaptureInfo(place, level, 0, is_success=True, index=taken)
            picture.file_url = f"IMG_{taken}.JPG"
            camera.respond_take_photo(_OK, picture)
            taken += 1
        elif name == "zoom":
            camera.respond_zoom_range(_OK)
        elif name == "focus":
            camera.respond_focus_range(_OK)
        elif name == "status":
            state = served.CaptureStatus(available_capacity_mib=5000.0, image_count=taken)
            camera.respond_capture_status(_OK, state)
        elif name == "storage":
            formatted = served.StorageInformation.StorageStatus.FORMATTED
            card = served.StorageInformation(3000.0, 5000.0, 8000.0, formatted, 1)
            camera.respond_storage_information(_OK, card)
        sys.stdout.write(json.dumps([name, value]) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
