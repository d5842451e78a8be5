"""What an emulated autopilot is like, and how bad its link is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from aerodaas.testing.channel import Impairment

__all__ = ["AutopilotOptions"]


@dataclass(frozen=True)
class AutopilotOptions:
    """One emulated vehicle."""

    family: Literal["px4", "ardupilot"] = "px4"
    system: int = 1
    vehicle_type: int = 2
    """MAV_TYPE of its HEARTBEAT; 2 is a quadrotor."""
    peer: tuple[str, int] = ("127.0.0.1", 14540)
    """Where it sends from the start; it also answers each sender."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it stands, ENU metres."""
    start_yaw: float = 0.0
    """Degrees counter-clockwise from east."""
    origin: tuple[float, float, float] = (47.397742, 8.545594, 488.0)
    """Where ENU zero lies: degrees, and metres above mean sea level."""
    estimator_origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """ENU metres of its local frame's own origin, which is wherever the estimator began."""
    ready_after: float = 0.5
    """Seconds until it knows its position and would arm; real ones take up to a minute."""
    battery: float = 0.9
    noise: float = 0.0
    """Scale of the sensors' noise; 1 is that of the simulated drone."""
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust: float = 0.0
    seed: int = 0
    key: bytes | None = None
    """Sign by this key, and refuse what is not signed."""
    parameters: dict[str, float] = field(default_factory=dict)
    """Other values than the family's own."""
    gimbal: bool = False
    """Whether it carries a gimbal, and is its manager."""
    camera: bool = False
    """Whether it carries a camera."""
    remote_id: bool = False
    """Whether it carries a Remote ID transmitter."""
    rangefinder: float | None = None
    """How steeply the ground rises to the east as its rangefinder sees it, metres a metre; None: it
    carries none."""
    actuators: bool = False
    """Whether it carries a gripper, servos, relays and a parachute."""
    components: tuple[int, ...] = ()
    """Ids of cameras (100 to 105) and gimbals (154, 171 to 175) that speak MAVLink themselves."""
    uplink: Impairment = field(default_factory=Impairment)
    """On the way to the vehicle."""
    downlink: Impairment = field(default_factory=Impairment)
