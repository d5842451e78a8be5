"""Remote ID and traffic with a real autopilot in simulation between us and them.

For ArduCopter with the parameters of `airspace.parm`. The transmitter is emulated, and knows only
what the autopilot tells it; so are the aircraft, of which the driver knows what is in the
autopilot's own list. Where an autopilot wants no transmitter, the tests are skipped.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pytest

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleState
from sitl.autopilot import Autopilot
from sitl.flights import SitlFlight, survey
from tools.mavlink_vehicle.transmitter import EmulatedTransmitter

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

NUMBER = "FIN87astrdge12k8"
OWN: dict[str, Any] = {
    "remote_id": {
        "operator_id": f"{NUMBER}-xyz",
        "uas_id": "1581F5FKD229400DR3K0",
        "description": "farm survey",
        "category": "open",
        "uas_class": 1,
    },
    "preflight": {"remote_id": "require"},
}
NEAR = {"action": "hold", "distance": 20.0, "height": 30.0, "lookahead": 4.0}


class Aboard:
    """Transmitter and receiver on the autopilot's wire, turned with the control loop."""

    def __init__(self, flight: SitlFlight) -> None:
        self._flight = flight
        self._codec = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_ODID_TXRX_1)
        self._receiver = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_ADSB)
        self.transmitter = EmulatedTransmitter(self._say, present=True)
        self.helicopter: tuple[float, float, float] | None = None
        """Where one hovers, ENU metres; None: nobody flies."""
        self.seen: list[VehicleState] = []
        """States with traffic."""
        self._heard = 0
        self._due = -math.inf

    def _say(self, message: Any) -> None:  # noqa: ANN401
        """To the autopilot and, on the same wire, to the driver."""
        packet = bytes(message.pack(self._codec))
        self._flight.relay.inject(packet)
        self._flight.relay.say(packet)

    def turn(self, state: VehicleState) -> None:
        """One turn."""
        now, told = time.monotonic(), self._flight.relay.witness.remote_id
        for message in told[self._heard :]:
            self.transmitter.hear(message, now)
        self._heard = len(told)
        self.transmitter.turn(now)
        if state.traffic:
            self.seen.append(state)
        if self.helicopter is not None and now >= self._due:
            self._due = now + 1.0
            self._flight.relay.inject(self._report(self.helicopter))

    def _report(self, place: tuple[float, float, float]) -> bytes:
        alignment = self._flight.vehicle.connection.alignment
        latitude, longitude, _ = alignment.origin.to_geodetic(np.array(place))
        assert alignment.sea_level is not None
        flags = (
            mavlink.ADSB_FLAGS_VALID_COORDS
            | mavlink.ADSB_FLAGS_VALID_ALTITUDE
            | mavlink.ADSB_FLAGS_VALID_HEADING
            | mavlink.ADSB_FLAGS_VALID_VELOCITY
            | mavlink.ADSB_FLAGS_VALID_CALLSIGN
        )
        message = mavlink.MAVLink_adsb_vehicle_message(
            *(0x4B1234, round(latitude * 1e7), round(longitude * 1e7)),
            mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH,
            round(1e3 * (alignment.sea_level + place[2])),
            *(0, 0, 0, b"HBXYZ", mavlink.ADSB_EMITTER_TYPE_ROTOCRAFT, 0, flags, 7000),
        )
        return bytes(message.pack(self._receiver))


def begun(autopilot: Autopilot, north: float, **limits: Any) -> SitlFlight:  # noqa: ANN401
    """A flight to one place; skips where the autopilot wants no transmitter."""
    flight = SitlFlight(autopilot.url, survey((0, north)), own=OWN, **limits)
    wanted = None if flight.px4 else flight.vehicle.parameters.get("DID_OPTIONS")
    if not wanted:
        flight.close()
        pytest.skip("this autopilot wants no Remote ID transmitter")
    return flight


def test_a_transmitter_behind_the_autopilot(autopilot: Autopilot) -> None:
    """Waited for, told all by way of the autopilot, and missed in flight."""
    with begun(autopilot, 12.0) as flight:
        aboard = Aboard(flight)
        aboard.transmitter.present = False
        flight.run(8.0, each=aboard.turn)
        assert flight.states == [S.PREFLIGHT], flight.story
        assert "no transmitter is heard" in flight.status.reason
        aboard.transmitter.present = True
        flight.run(60.0, lambda: flight.mission.state is S.ENROUTE, aboard.turn)
        assert flight.states[-1] is S.ENROUTE, flight.story
        told = aboard.transmitter.newest
        assert told["OPEN_DRONE_ID_OPERATOR_ID"].operator_id == NUMBER
        assert bytes(told["OPEN_DRONE_ID_BASIC_ID"].uas_id).decode() == OWN["remote_id"]["uas_id"]
        assert told["OPEN_DRONE_ID_SELF_ID"].description == "farm survey"
        assert told["OPEN_DRONE_ID_SYSTEM"].category_eu == mavlink.MAV_ODID_CATEGORY_EU_OPEN
        location = told["OPEN_DRONE_ID_LOCATION"]
        assert told["OPEN_DRONE_ID_SYSTEM"].operator_latitude == pytest.approx(
            location.latitude, abs=1000
        )
        aboard.transmitter.present = False
        flight.run(120.0, each=aboard.turn)
        assert flight.mission.state is S.LANDED, flight.story
        alerts = [alert.text for alert in flight.mission.alerts]
        assert any("Remote ID: the transmitter has said nothing" in text for text in alerts), alerts
        flight.tell_outcome("a transmitter lost in flight")


def test_a_helicopter_on_the_way(autopilot: Autopilot) -> None:
    """It is waited for at its distance, by the simulator's own truth, until it is gone."""
    with begun(autopilot, 40.0, traffic=NEAR) as flight:
        aboard = Aboard(flight)
        flight.run(60.0, lambda: flight.mission.state is S.ENROUTE, aboard.turn)
        assert flight.states[-1] is S.ENROUTE, flight.story
        aboard.helicopter = (0.0, 45.0, 5.0)
        flight.run(25.0, each=aboard.turn)
        assert [*flight.states].pop() is S.HOLDING, flight.story
        truth = flight.relay.witness.place
        assert truth is not None
        assert 15.0 < truth[1] < 26.0, flight.story
        (one,) = aboard.seen[-1].traffic
        assert one.callsign == "HBXYZ"
        assert one.position.tolist() == pytest.approx([0.0, 45.0, 5.0], abs=1.0)
        aboard.helicopter = None
        flight.run(150.0, each=aboard.turn)
        assert flight.mission.state is S.LANDED, flight.story
        assert list(flight.status.visited) == ["wp1"]
        assert flight.states.count(S.HOLDING) == 1
        (told,) = {alert.text for alert in flight.mission.alerts if alert.kind == "traffic"}
        assert "HBXYZ" in told
        flight.tell_outcome("a helicopter on the way")
