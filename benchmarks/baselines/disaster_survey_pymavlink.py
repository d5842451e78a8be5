"""Disaster Survey on an ArduCopter, by pymavlink, with waypoints that a remote user adds.

python disaster_survey_pymavlink.py udpin:0.0.0.0:14550 udp://0.0.0.0:5600 8350
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
from ardupilot_copter import Copter
from surveying import fly_to
from video import Video

HEIGHT, SPEED, HOVER = 1.5, 1.5, 3.0
CORNERS = {"wp1": (0, 0), "wp2": (10, 0), "wp3": (10, 10), "wp4": (0, 10)}
Place = tuple[float, float, float]


class Survey:
    """The waypoints that are left, which the flight and the remote user share."""

    def __init__(self) -> None:
        self.left: dict[str, Place] = {name: (x, y, HEIGHT) for name, (x, y) in CORNERS.items()}
        self.visited: list[str] = []
        self.lock = threading.Lock()

    def take_nearest(self, here: Place) -> tuple[str, Place]:
        """Take the waypoint that is nearest to a place; raises KeyError without one."""
        with self.lock:
            name = min(self.left, key=lambda one: math.dist(here, self.left[one]), default="")
            return name, self.left.pop(name)

    def add(self, waypoints: list[list[float | str]]) -> None:
        """Add waypoints: name, x, y and z of each."""
        new = {str(name): (float(x), float(y), float(z)) for name, x, y, z in waypoints}
        with self.lock:
            self.left.update(new)


def serve(port: int, survey: Survey, video: Video) -> None:
    """Answer the remote user: what is visited, what the camera sees, new waypoints."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == "/frame.jpg":
                _, picture = cv2.imencode(".jpg", video.next())
                self.answer(200, picture.tobytes(), "image/jpeg")
            else:
                self.answer(200, json.dumps({"visited": survey.visited}).encode())

        def do_POST(self) -> None:
            try:
                survey.add(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self.answer(200, b'{"accepted": true}')
            except (ValueError, TypeError) as error:
                self.answer(422, json.dumps({"accepted": False, "text": str(error)}).encode())

        def answer(self, status: int, body: bytes, kind: str = "application/json") -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.end_headers()
            self.wfile.write(body)

    server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()


def main() -> None:
    """Visit what is left, the nearest first, until nothing is, and come back."""
    url, camera, port = sys.argv[1:]
    copter, survey, video = Copter(url), Survey(), Video(camera)
    serve(int(port), survey, video)
    print("taking_off")
    copter.take_off(HEIGHT, SPEED)
    while survey.left:
        name, place = survey.take_nearest(copter.position)
        print("enroute", name)
        fly_to(copter, place)
        print("loitering", name)
        survey.visited.append(name)
        time.sleep(HOVER)
    print("returning")
    fly_to(copter, (0, 0, HEIGHT))
    print("landing")
    copter.land()
    print("landed")
    video.close()


if __name__ == "__main__":
    main()
