"""Contact of a simulated drone with the objects of its world.

A hard contact stops the motors; a slow one blocks the motion, and from above the drone rests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.simulation.collision import BODY, Nearest, Obstacles
from aerodaas.simulation.dynamics import STEP, Multirotor, Triple

__all__ = ["Collision", "Contacts"]

_HARD = 0.5
"""m/s towards an object from which on a contact stops the motors."""
_BOUNCE = 0.2
"""Share of that speed with which the drone comes off again after a hard contact."""
_LEVEL = 0.7
"""Upward part of the surface's normal from which on a drone rests on it: up to 45 degrees."""
_IDLE = 9
"""Steps that are left out where nothing can be reached in them, nor in the next one."""
_FASTER = 4.0
"""m/s by which a drone is faster at most after these steps, by thrust, gravity and wind."""
_STILL = 0.3
"""m/s below which a drone without thrust that touches something is caught in it."""


@dataclass(frozen=True, slots=True)
class Collision:
    """Collision of a drone: with what, where and how fast."""

    what: str
    """Kind and id of the object, or `the ground`."""
    place: Triple
    """Of the drone, ENU metres."""
    speed: float
    """Towards the object, m/s."""

    def __str__(self) -> str:
        """Return the fault in words."""
        x, y, z = self.place
        where = f"({x:.1f}, {y:.1f}, {z:.1f})"
        # It begins with `messages.vehicle.COLLISION`, by which the mission knows it.
        return f"collision with {self.what} at {where} at {self.speed:.1f} m/s"


class Contacts:
    """Finds contacts of one drone, and changes its motion by them."""

    def __init__(self, obstacles: Obstacles, rotor: Multirotor) -> None:
        """Look for contacts of `rotor`, which stands on its ground.

        Objects stand on the plane z = 0, and rise and fall with the ground.
        """
        self._obstacles = obstacles
        self._rotor = rotor
        self._level = rotor.ground
        self._around: frozenset[str] = frozenset()
        """Objects within which the drone was when it lifted off, and from which it has not come."""
        self._stood = True
        self._idle = 0
        """Steps that are still to be left out."""

    def step(self, before: Triple, time: float, *, powered: bool) -> Collision | None:
        """Block the step that the drone has just made into an object.

        Args:
            before: Place before the step, ENU metres.
            time: Mission time, seconds.
            powered: Whether its motors run.

        Returns:
            The collision, for a hard contact; None for a slow one, and without any.
        """
        if self._idle:
            self._idle -= 1
            return None
        rotor = self._rotor
        if rotor.on_ground:
            self._stood = True
            return None
        x, y, z = rotor.position
        point = (x, y, z - (rotor.ground - self._level))
        if self._stood or self._around:
            around = self._things_around(point, time)
            self._around = around if self._stood else self._around & around
            self._stood = False
        pace = math.hypot(*rotor.velocity) + _FASTER + self._obstacles.fastest
        reach = BODY + (_IDLE + 1) * STEP * pace
        near = self._obstacles.within(point, time, reach, self._around)
        if near is None:
            self._idle = _IDLE
            return None
        if near.distance >= BODY:
            return None
        return self._touch(near, point, before, powered=powered)

    def _things_around(self, point: Triple, time: float) -> frozenset[str]:
        """Objects within which a point is."""
        found: frozenset[str] = frozenset()
        while (near := self._obstacles.nearest(point, time, found)) and near.distance <= 0.0:
            found |= {near.thing}
        return found

    def _touch(
        self, near: Nearest, point: Triple, before: Triple, *, powered: bool
    ) -> Collision | None:
        rotor = self._rotor
        vx, vy, vz = (own - its for own, its in zip(rotor.velocity, near.velocity, strict=True))
        moving = math.hypot(vx, vy, vz)
        if near.distance > 0.0:
            nx, ny, nz = (
                (own - its) / near.distance for own, its in zip(point, near.place, strict=True)
            )
        elif moving > 0.0:
            nx, ny, nz = -vx / moving, -vy / moving, -vz / moving
        else:
            return None
        speed = -(vx * nx + vy * ny + vz * nz)
        if speed <= 0.0:
            return None
        place, hard = rotor.position, speed > _HARD
        if near.distance > 0.0:
            out = BODY - near.distance
            rotor.position = place[0] + out * nx, place[1] + out * ny, place[2] + out * nz
        else:
            rotor.position = before
        back = speed * (1.0 + _BOUNCE) if hard else speed
        rotor.velocity = (
            rotor.velocity[0] + back * nx,
            rotor.velocity[1] + back * ny,
            rotor.velocity[2] + back * nz,
        )
        if (nz > _LEVEL and not (hard and powered)) or (not powered and moving < _STILL):
            rotor.rest()
        return Collision(f"{near.label} {near.thing}", place, speed) if hard else None
