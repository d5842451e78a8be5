"""Pictures at waypoints: taken when the gimbal is there; lost, and the flight not, by any fault."""

from __future__ import annotations

import math

import pytest
from flights import Flight, KinematicVehicle, add, flight
from surveyors import Surveyor, lost, patience

from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import GimbalTarget, LensTarget
from aerodaas.messages.mission import MissionState
from aerodaas.messages.waypoints import Waypoint

DOWN = -math.pi / 2


STOPS = (
    Waypoint("north", 0, 5, 2, gimbal_pitch=DOWN, photo=True),
    Waypoint("east", 5, 5, 2, gimbal_pitch=-0.5, gimbal_yaw=1.0, photo=True),
)


def flown(vehicle: KinematicVehicle, *waypoints: Waypoint, timeout: float = 4.0) -> Flight:
    """A whole flight over `waypoints`, with `timeout` seconds for each picture."""
    made = flight(
        add(*(waypoints or STOPS)),
        vehicle=vehicle,
        options=patience(timeout),
    )
    made.run()
    return made


def unharmed(made: Flight) -> None:
    """The flight ended as it would without a camera."""
    made.expect(MissionState.LANDED)
    assert list(made.status.visited) == ["north", "east"]


def test_each_picture_is_taken_once_the_gimbal_looks_there() -> None:
    """The picture has the attitude that the waypoint asks for."""
    vehicle = Surveyor()
    made = flown(vehicle)
    unharmed(made)
    assert vehicle.photo_camera is not None
    assert vehicle.photo_camera.asked == ["north", "east"]
    first, second = made.mission.photos
    assert first.gimbal is not None
    assert second.gimbal is not None
    assert abs(first.gimbal.pitch - DOWN) < 0.06
    assert abs(second.gimbal.pitch + 0.5) < 0.06
    assert abs(second.gimbal.yaw - 1.0) < 0.06
    assert not lost(made)
    assert made.status.photos == (2, 0)


def test_the_gimbal_turns_on_the_way() -> None:
    """It is told when the drone sets out, not when it has arrived."""
    vehicle = Surveyor()
    made = flight(add(*STOPS), vehicle=vehicle)
    made.run_to(MissionState.ENROUTE)
    made.turn()
    assert vehicle.gimbal is not None
    assert vehicle.gimbal.aims


def test_the_drone_stays_until_the_picture_is_there() -> None:
    """Without a hover of its own, and no longer than that."""
    vehicle = Surveyor()
    assert vehicle.photo_camera is not None
    vehicle.photo_camera.silent = True
    made = flight(add(STOPS[0]), vehicle=vehicle, options=patience(4.0))
    made.run_to(MissionState.LOITERING)
    began = made.seconds
    made.run(until=lambda: made.mission.state is not MissionState.LOITERING)
    assert 3.5 < made.seconds - began < 4.5


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("no gimbal", "no gimbal"),
        ("no camera", "no camera"),
        ("stuck", "it looks at pitch 0, yaw 0 degrees: motor hot"),
        ("nonsense", "it does not say where it looks"),
        ("stale", "it does not say where it looks"),
        ("refuses", "no card"),
        ("silent", "took none within 4 s"),
        ("lies", "took none within 4 s"),
    ],
)
def test_a_component_at_fault_costs_its_picture_and_not_the_flight(fault: str, told: str) -> None:
    """Each is told with its reason, and the waypoint counts as visited."""
    vehicle = Surveyor()
    gimbal, camera = vehicle.gimbal, vehicle.photo_camera
    assert gimbal is not None
    assert camera is not None
    if fault == "no gimbal":
        vehicle.gimbal = None
    elif fault == "no camera":
        vehicle.photo_camera = None
    elif fault == "refuses":
        camera.refuses = "no card"
    elif fault in {"silent", "lies"}:
        setattr(camera, fault, True)
    else:
        setattr(gimbal, fault, True)
        gimbal.fault = "motor hot"
    made = flown(vehicle)
    unharmed(made)
    assert made.status.photos[1] == 2
    assert any("north: no picture: " in text and told in text for text in lost(made)), lost(made)


def test_a_vehicle_without_any_of_it_flies_on() -> None:
    """No driver needs to know of pictures."""
    made = flown(KinematicVehicle())
    unharmed(made)
    assert made.status.photos == (0, 2)
    assert len(lost(made)) >= 1


def test_components_that_vanish_in_mid_flight() -> None:
    """What was taken before stays; what follows is lost and told."""
    vehicle = Surveyor()
    made = flight(add(*STOPS), vehicle=vehicle, options=patience(4.0))
    made.run(until=lambda: made.status.visits == 1)
    vehicle.gimbal = vehicle.photo_camera = None
    made.run()
    unharmed(made)
    assert made.status.photos == (1, 1)
    assert any(text.startswith("east: no picture") for text in lost(made))


@pytest.mark.parametrize("error", [VehicleError("link down"), RuntimeError("a bug"), KeyError(1)])
def test_what_a_component_raises_ends_no_flight(error: Exception) -> None:
    """An exception is its picture alone."""

    class Broken:
        """Raises whatever it is asked."""

        def __getattr__(self, _: str) -> object:
            raise error

    vehicle = Surveyor()
    vehicle.gimbal = vehicle.photo_camera = Broken()  # type: ignore[assignment]
    made = flown(vehicle)
    unharmed(made)
    assert lost(made)


def test_a_gimbal_is_aimed_without_a_picture() -> None:
    """Yaw alone leaves the pitch level."""
    vehicle = Surveyor()
    made = flown(vehicle, Waypoint("north", 0, 5, 2, gimbal_yaw=0.5))
    assert vehicle.photo_camera is not None
    assert vehicle.gimbal is not None
    assert vehicle.photo_camera.asked == []
    assert vehicle.gimbal.aims[0] == GimbalTarget(0.0, 0.5)
    assert not lost(made)


def test_a_deaf_gimbal_is_told_again() -> None:
    """Every two seconds, not at each turn."""
    vehicle = Surveyor()
    assert vehicle.gimbal is not None
    vehicle.gimbal.stuck = True
    flown(vehicle)
    assert 4 <= len(vehicle.gimbal.aims) <= 20


def test_a_failsafe_does_not_wait_for_a_picture() -> None:
    """The battery is minded while the drone hovers for a camera that never answers."""
    vehicle = Surveyor()
    assert vehicle.photo_camera is not None
    vehicle.photo_camera.silent = True
    made = flight(
        add(STOPS[0]),
        vehicle=vehicle,
        options=patience(100.0),
    )
    made.run_to(MissionState.LOITERING)
    vehicle.charge = 0.2
    made.run(2.0)
    made.expect(MissionState.RETURNING)


def test_an_interrupted_stop_has_its_picture_later() -> None:
    """Once, however often the drone comes."""
    vehicle = Surveyor()
    assert vehicle.gimbal is not None
    made = flight(add(STOPS[0]), vehicle=vehicle)
    made.run_to(MissionState.LOITERING)
    made.tell(add(Waypoint("urgent", 3, 5, 2, priority=1)))
    made.run()
    made.expect(MissionState.LANDED)
    assert set(made.status.visited) == {"urgent", "north"}
    assert made.status.photos == (1, 0)


def test_the_time_out_begins_anew_after_an_interruption() -> None:
    """A long detour takes nothing from what gimbal and camera get."""
    vehicle = Surveyor()
    assert vehicle.gimbal is not None
    vehicle.gimbal.stuck = True
    made = flight(add(STOPS[0]), vehicle=vehicle, options=patience(4.0))
    made.run_to(MissionState.LOITERING)
    made.tell(add(Waypoint("urgent", 3, 5, 2, priority=1, hover_duration=5)))
    made.run(until=lambda: "urgent" in made.status.visited)
    vehicle.gimbal.stuck = False
    made.run()
    made.expect(MissionState.LANDED)
    assert made.status.photos == (1, 0)


ZOOMED = (
    Waypoint("north", 0, 5, 2, zoom=40, photo=True),
    Waypoint("east", 5, 5, 2, zoom=40, focus=100, photo=True),
)


def test_the_lens_is_set_before_the_picture() -> None:
    """On the way there, once for each waypoint that asks for something else."""
    vehicle = Surveyor()
    assert vehicle.photo_camera is not None
    made = flown(vehicle, *ZOOMED)
    unharmed(made)
    assert vehicle.photo_camera.lens == [LensTarget(40, None), LensTarget(40, 100)]
    assert made.status.photos == (2, 0)
    assert not lost(made)


def test_a_lens_that_is_not_set_costs_its_picture() -> None:
    """Refused, or never acknowledged; without a picture it is told all the same."""
    vehicle = Surveyor()
    assert vehicle.photo_camera is not None
    vehicle.photo_camera.lens_refuses = "denied"
    made = flown(vehicle, *ZOOMED)
    unharmed(made)
    assert made.status.photos == (0, 2)
    assert "north: no picture: the camera's lens: denied" in lost(made)[0]
    hanging = Surveyor()
    assert hanging.photo_camera is not None
    hanging.photo_camera.lens_hangs = True
    made = flown(hanging, ZOOMED[0])
    made.expect(MissionState.LANDED)
    assert lost(made) == ["north: no picture: the lens was not set within 4 s"]
    blind = Surveyor()
    blind.photo_camera = None
    made = flown(blind, Waypoint("north", 0, 5, 2, zoom=40))
    made.expect(MissionState.LANDED)
    assert lost(made)[0].startswith("north: lens not set: the vehicle has no camera")
