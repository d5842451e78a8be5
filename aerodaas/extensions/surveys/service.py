"""Route of a service that plans the surveys drawn on its map.

It plans one at a time, for each takes a core a while.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from fastapi import APIRouter, Request

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.errors import MissionError
from aerodaas.extensions.surveys.messages import SurveyIn, SurveyOut, SurveyPhotosOut
from aerodaas.extensions.surveys.planning import (
    SurveyPhotos,
    SurveySettings,
    planned_survey,
    survey_camera,
)
from aerodaas.messages.mission import Place, RobotStatus
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.schedulers.trajectory.coverage import footprint
from aerodaas.service.backend import Missions
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission

__all__ = ["survey_router"]

_PATIENCE = 10.0
"""Wall seconds for which a request waits for the one before it."""
_MOST_ASKED = 3
"""Requests at once, of which one is planned: each has a thread that a command to a drone may need.
"""
_BUSY = "other surveys are being planned: ask again in a moment"


def survey_router(missions: Missions, admission: Admission) -> APIRouter:
    """Make the route `/v1/missions/{id}/survey`.

    Args:
        missions: Missions whose drones survey.
        admission: Access to them.
    """
    router = api_router("/v1/missions", "missions")
    planner = _SurveyPlanner()

    @router.post("/{mission}/survey")
    def survey(mission: str, body: SurveyIn, request: Request) -> SurveyOut:
        """Plan the survey of an area by one of the mission's robots; nothing is flown."""
        principal = admission.require(request, Role.PILOT, Scope.FLY)
        config = missions.environment(principal, mission)
        status = missions.mission(principal, mission).status.get(body.robot)
        return planner.plan(body, config, status)

    return router


class _SurveyPlanner:
    """Plans surveys for drones in flight; safe in any thread."""

    def __init__(self) -> None:
        self._busy = threading.Lock()
        self._places = threading.BoundedSemaphore(_MOST_ASKED)

    def plan(
        self, wanted: SurveyIn, config: EnvironmentConfig, status: RobotStatus | None
    ) -> SurveyOut:
        """Plan a survey by a robot.

        Args:
            wanted: Area and settings of the survey, and the robot.
            config: Environment of the mission.
            status: Newest status of the robot; None if it does not fly.

        Raises:
            MissionError: If the robot does not fly, or other surveys are planned.
            SchedulerError: If the survey cannot be flown.
        """
        robot = next((one for one in config.robots if one.id == wanted.robot), None)
        if robot is None or status is None:
            raise MissionError(f"{wanted.robot} does not fly in this mission")
        settings = _settings(robot, wanted)
        start, wind = _start(status, robot.start), np.array(config.simulation.wind)
        with self._waiting():
            survey = planned_survey(
                robot, wanted.area, settings, start=np.array(start, dtype=np.float64), wind=wind
            )
        named = (replace(one, id=f"{wanted.name}-{n}") for n, one in enumerate(survey.waypoints, 1))
        reserve = robot.limits.battery_land
        return SurveyOut(
            waypoints=list(named),
            height=settings.height,
            width=settings.strips[0],
            angle=survey.angle,
            sweeps=survey.sweeps,
            length=survey.length,
            seconds=survey.seconds,
            battery=survey.battery,
            available=None if status.charge is None else max(0.0, status.charge - reserve),
            start=start,
            photos=_photos(survey.photos),
        )

    @contextmanager
    def _waiting(self) -> Iterator[None]:
        """Wait for the requests before, if they are few; raises MissionError otherwise."""
        if not self._places.acquire(blocking=False):
            raise MissionError(_BUSY)
        try:
            if not self._busy.acquire(timeout=_PATIENCE):
                raise MissionError(_BUSY)
            try:
                yield
            finally:
                self._busy.release()
        finally:
            self._places.release()


def _settings(robot: RobotConfig, wanted: SurveyIn) -> SurveySettings:
    """How the survey is flown; raises SchedulerError for a camera that cannot survey."""
    if wanted.camera is not None:
        camera = survey_camera(
            robot,
            wanted.camera,
            front_overlap=wanted.front_overlap,
            side_overlap=wanted.overlap,
        )
        return SurveySettings.by_camera(
            camera,
            height=wanted.height,
            ground_resolution=wanted.ground_resolution,
            angle=wanted.angle,
            speed=wanted.speed,
            around=wanted.around,
        )
    assert wanted.height is not None  # noqa: S101 - checked by the model
    width = wanted.width
    if width is None:
        assert wanted.field_of_view is not None  # noqa: S101 - checked by the model
        width, _ = footprint(wanted.height, wanted.field_of_view)
    return SurveySettings(
        wanted.height, width, wanted.overlap, wanted.angle, wanted.speed, wanted.around
    )


def _photos(photos: SurveyPhotos | None) -> SurveyPhotosOut | None:
    if photos is None:
        return None
    return SurveyPhotosOut(
        places=[(round(east, 2), round(north, 2)) for east, north in photos.places],
        spacing=photos.spacing,
        interval=photos.interval,
        line_spacing=photos.line_spacing,
        resolution=photos.resolution,
        warning=photos.warning,
    )


def _start(status: RobotStatus, takeoff: Place) -> Place:
    """Where the drone will come from: its last coming waypoint, or where it is."""
    if ahead := status.mission.ahead:
        return ahead[-1].x, ahead[-1].y, ahead[-1].z
    return status.place or takeoff
