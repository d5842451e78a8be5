"""What real autopilots were seen to say in each situation: the emulated ones are held to it.

Recorded from PX4 v1.16.1 (SIH) and ArduCopter 4.7.0-dev in simulation, each started afresh with
its own parameters. A fact that is None was not recorded, or is not always the same.
"""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.drivers.mavlink.wire.dialect import mavlink as mav

__all__ = ["ACKS", "FACTS", "VERSIONS", "Fact"]

_CHECK: int = mav.MAV_SYS_STATUS_PREARM_CHECK
_GPS: int = mav.MAV_SYS_STATUS_SENSOR_GPS
_PLACE: int = mav.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
_RC: int = mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
_HORIZONTAL: int = mav.ESTIMATOR_POS_HORIZ_ABS | mav.ESTIMATOR_VELOCITY_HORIZ
_STILL: int = mav.ESTIMATOR_CONST_POS_MODE


@dataclass(frozen=True)
class Fact:
    """One situation of one family; the sets of bits are those of SYS_STATUS."""

    armed: bool
    state: int | None
    """MAV_STATE."""
    landed: int
    """MAV_LANDED_STATE."""
    present: int = 0
    """Bits that are set in `onboard_control_sensors_present`."""
    absent: int = 0
    """Bits that are not."""
    healthy: int = 0
    sick: int = 0
    """Bits that are set in `onboard_control_sensors_health`, and bits that are not."""
    estimator: int = 0
    lost: int = 0
    """Flags of the estimator's report that are set, and flags that are not."""
    fix: int | None = None
    """GPS_RAW_INT's fix type."""
    mode: int | None = None
    """HEARTBEAT's custom mode."""


_GROUND, _AIR = mav.MAV_LANDED_STATE_ON_GROUND, mav.MAV_LANDED_STATE_IN_AIR

FACTS: dict[tuple[str, str], Fact] = {
    ("px4", "starting"): Fact(
        armed=False,
        state=mav.MAV_STATE_UNINIT,
        landed=_GROUND,
        present=_PLACE,
        absent=_CHECK | _GPS,
        sick=_CHECK | _PLACE | _RC,
        lost=_HORIZONTAL,
        estimator=_STILL,
    ),
    ("px4", "ready"): Fact(
        armed=False,
        state=mav.MAV_STATE_STANDBY,
        landed=_GROUND,
        present=_PLACE | _GPS,
        absent=_CHECK | _RC,
        healthy=_CHECK | _PLACE | _GPS,
        sick=_RC,
        estimator=_HORIZONTAL | _STILL,
        fix=3,
    ),
    ("px4", "holding in the air"): Fact(
        armed=True,
        state=mav.MAV_STATE_ACTIVE,
        landed=_AIR,
        present=_PLACE | _GPS,
        absent=_CHECK,
        healthy=_CHECK | _PLACE | _GPS,
        estimator=_HORIZONTAL,
        lost=_STILL,
        fix=3,
    ),
    ("px4", "GPS lost for 2 s"): Fact(
        armed=True,
        state=mav.MAV_STATE_ACTIVE,
        landed=_AIR,
        present=_PLACE | _GPS,
        healthy=_CHECK | _PLACE | _GPS,
        estimator=_HORIZONTAL,
        fix=0,
    ),
    ("px4", "GPS lost for 9 s"): Fact(
        armed=True,
        state=mav.MAV_STATE_CRITICAL,
        landed=_AIR,
        absent=_GPS,
        sick=_CHECK | _PLACE,
        lost=_HORIZONTAL | _STILL,
        fix=0,
    ),
    ("px4", "setpoints stopped for 3 s"): Fact(
        armed=True,
        state=mav.MAV_STATE_CRITICAL,
        landed=_AIR,
        fix=3,
        mode=3 << 16,
    ),
    ("px4", "motors killed in the air"): Fact(
        armed=False,
        state=mav.MAV_STATE_STANDBY,
        landed=_GROUND,
        fix=3,
    ),
    ("px4", "terminated in the air"): Fact(
        armed=True,
        state=mav.MAV_STATE_FLIGHT_TERMINATION,
        landed=_AIR,
        sick=_CHECK,
        fix=3,
    ),
    ("px4", "restarted in the air"): Fact(
        armed=False,
        state=mav.MAV_STATE_UNINIT,
        landed=_GROUND,
        absent=_CHECK | _GPS,
        sick=_CHECK | _PLACE,
        lost=_HORIZONTAL,
    ),
    ("px4", "told to land 0.3 s after arming"): Fact(
        armed=True,
        state=mav.MAV_STATE_ACTIVE,
        landed=_GROUND,
        healthy=_CHECK,
    ),
    ("ardupilot", "starting"): Fact(
        armed=False,
        state=None,
        landed=_GROUND,
        present=_CHECK | _PLACE,
        absent=_GPS,
        sick=_CHECK | _GPS,
        lost=mav.EKF_POS_HORIZ_ABS,
    ),
    ("ardupilot", "ready"): Fact(
        armed=False,
        state=mav.MAV_STATE_STANDBY,
        landed=_GROUND,
        present=_CHECK | _PLACE | _GPS,
        healthy=_CHECK | _PLACE | _GPS,
        estimator=_HORIZONTAL,
        lost=_STILL,
    ),
    ("ardupilot", "holding in the air"): Fact(
        armed=True,
        state=mav.MAV_STATE_ACTIVE,
        landed=_AIR,
        present=_CHECK | _PLACE | _GPS,
        healthy=_CHECK | _PLACE | _GPS,
        estimator=_HORIZONTAL,
    ),
    ("ardupilot", "GPS lost for 2 s"): Fact(
        armed=True,
        state=mav.MAV_STATE_ACTIVE,
        landed=_AIR,
        healthy=_CHECK | _PLACE | _GPS,
        estimator=_HORIZONTAL,
        fix=1,
    ),
    ("ardupilot", "GPS lost for 9 s"): Fact(
        armed=True,
        state=mav.MAV_STATE_CRITICAL,
        landed=mav.MAV_LANDED_STATE_LANDING,
        present=_GPS | _PLACE,
        healthy=_CHECK | _GPS,
        sick=_PLACE,
        lost=_HORIZONTAL,
        fix=1,
    ),
    ("ardupilot", "motors killed in the air"): Fact(armed=False, state=None, landed=_GROUND),
}

_OK, _LATER = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_TEMPORARILY_REJECTED

ACKS: dict[tuple[str, str, str], int] = {
    ("px4", "starting", "arm"): _LATER,
    ("px4", "ready", "arm"): _OK,
    ("px4", "ready", "disarm"): _OK,
    ("px4", "holding in the air", "disarm"): _LATER,
    ("px4", "holding in the air", "kill"): _OK,
    ("px4", "told to land 0.3 s after arming", "disarm"): _OK,
    ("ardupilot", "starting", "arm"): mav.MAV_RESULT_FAILED,
    ("ardupilot", "holding in the air", "kill"): _OK,
    ("ardupilot", "holding in the air", "disarm"): mav.MAV_RESULT_FAILED,
}
"""What is acknowledged to an order in a situation."""

VERSIONS = {"px4": (1, 16, 1), "ardupilot": (4, 7, 0)}
