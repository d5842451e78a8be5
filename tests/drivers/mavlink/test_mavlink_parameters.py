"""Parameters of an autopilot: asked until they are told, set until they show to be set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from autopilot import ScriptedAutopilot

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices.parameters import Parameters, unsafe_parameters
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError

INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32
READ, SET = "PARAM_REQUEST_READ", "PARAM_SET"


class Store:
    """The parameters of a scripted autopilot, and how many of its answers get lost."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, held: dict[str, float]) -> None:
        self.held, self.kind, self.lost = held, REAL32, 0
        self.stubborn = False
        self.noise: list[Any] = []
        self.autopilot = ScriptedAutopilot("ardupilot", answers={READ: self._tell, SET: self._set})
        self.autopilot.clock.drive(monkeypatch)
        self.parameters = Parameters(self.autopilot, ArduPilot())  # type: ignore[arg-type]

    def message(self, name: str, value: float) -> Any:  # noqa: ANN401 - pymavlink has no types
        """A value on the wire."""
        return mavlink.MAVLink_param_value_message(name.encode(), value, self.kind, 9, 1)

    def _tell(self, request: Any) -> list[Any]:  # noqa: ANN401
        self.lost -= 1
        if self.lost >= 0:
            return []
        name = request.param_id
        told = [self.message(name, self.held[name])] if name in self.held else []
        return [*self.noise, *told]

    def _set(self, request: Any) -> list[Any]:  # noqa: ANN401
        if not self.stubborn:
            self.held[request.param_id] = request.param_value
        return self._tell(request)

    def times(self) -> list[float]:
        """When it was asked, from the first time on."""
        began = self.autopilot.received[0][0]
        return [at - began for at, _ in self.autopilot.received]


Make = Callable[[dict[str, float]], Store]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Make:
    """An autopilot that holds some parameters."""
    return lambda held: Store(monkeypatch, held)


def test_a_value_is_asked_for_by_name(make: Make) -> None:
    """Of the vehicle; others that come meanwhile are not it."""
    store = make({"FENCE": 5.0, "ZERO": 0.0})
    store.noise = [store.message("FENCE_TYPE", 9.0), store.message("FENC", 8.0)]
    assert store.parameters.get("FENCE") == 5.0
    assert store.parameters.get("ZERO") == 0.0
    request = store.autopilot.of(READ)[0]
    assert (request.target_system, request.target_component) == (1, 1)
    assert (request.param_id, request.param_index) == ("FENCE", -1)


def test_what_is_not_told_is_asked_for_four_times(make: Make) -> None:
    """Each 0.7 s, however much others talk; the fourth time may be the one that is heard."""
    store = make({"FENCE": 5.0})
    store.lost = 3
    assert store.parameters.get("FENCE") == 5.0
    assert store.times() == pytest.approx([0.0, 0.7, 1.4, 2.1])
    chatty = make({})
    chatty.noise = [chatty.message("OTHER", 1.0)] * 100
    assert chatty.parameters.get("FENCE") is None
    assert chatty.times() == pytest.approx([0.0, 0.7, 1.4, 2.1], abs=0.05)


def test_a_value_is_set_and_seen_to_be(make: Make) -> None:
    """Read first; what it is already is not set."""
    store = make({"FENCE": 5.0})
    store.parameters.set("FENCE", 5.0)
    assert store.autopilot.kinds() == [READ]
    store.parameters.set("FENCE", 6.5)
    assert store.held["FENCE"] == 6.5
    assert store.autopilot.kinds()[1:] == [READ, SET]
    (said,) = store.autopilot.of(SET)
    assert (said.param_id, said.param_value, said.param_type) == ("FENCE", 6.5, REAL32)


@pytest.mark.parametrize(
    ("held", "wanted", "same"),
    [(1.0, 1.00001, True), (1.0, 1.00002, False), (-1e4, -10000.09, True), (1e4, 10000.2, False)],
)
def test_singles_are_the_same_to_five_digits(
    make: Make, held: float, wanted: float, *, same: bool
) -> None:
    """A hundred-thousandth of the value, or of one where that is more."""
    store = make({"FENCE": held})
    store.parameters.set("FENCE", wanted)
    assert (SET not in store.autopilot.kinds()) is same


def test_an_integer_of_px4_travels_by_its_bytes(make: Make) -> None:
    """There and back; 3 is 4.2e-45 to whoever reads a single."""
    px4 = PX4()
    store = make({"GF_ACTION": px4.encode(1.0, INT32)})
    store.kind = INT32
    parameters = Parameters(store.autopilot, px4)  # type: ignore[arg-type]
    assert parameters.get("GF_ACTION") == 1.0
    parameters.set("GF_ACTION", 3.0)
    assert 0.0 < store.held["GF_ACTION"] < 1e-40
    assert parameters.get("GF_ACTION") == 3.0


def test_what_is_not_set_is_said(make: Make) -> None:
    """A name that it does not know, and a value that stays."""
    with pytest.raises(VehicleError, match="knows no parameter FENCE"):
        make({}).parameters.set("FENCE", 1.0)
    store = make({"FENCE": 2.0})
    store.stubborn = True
    with pytest.raises(VehicleError, match="did not set FENCE to 3: it is 2"):
        store.parameters.set("FENCE", 3.0)
    assert store.autopilot.kinds().count(SET) == 4


def test_a_set_whose_answers_get_lost_is_found_set(make: Make) -> None:
    """Read again before it is called a failure."""
    store = make({"FENCE": 2.0})
    store.autopilot.silent.add(SET)
    store.autopilot.answers[READ] = lambda request: [store.message(request.param_id, values.pop())]
    values = [3.0, 2.0]
    store.parameters.set("FENCE", 3.0)
    assert store.autopilot.kinds() == [READ, *[SET] * 4, READ]


def test_a_name_has_sixteen_letters_at_most(make: Make) -> None:
    """A longer one would be another parameter's."""
    assert make({"A" * 16: 1.0}).parameters.get("A" * 16) == 1.0
    with pytest.raises(VehicleError, match="no parameter's name is as long as 'AAAA"):
        make({}).parameters.get("A" * 17)


def test_what_leaves_a_vehicle_unprotected(make: Make) -> None:
    """By its value; what is not known is not told, and costs the time of one value in all."""
    store = make({"BATT_FS_LOW_ACT": 0.0, "FS_EKF_ACTION": 1.0})
    (one,) = unsafe_parameters(store.parameters, ArduPilot())
    assert (one.failsafe.name, one.failsafe.safe, one.value) == ("BATT_FS_LOW_ACT", 2.0, 0.0)
    assert "BATT_FS_LOW_ACT is 0" in one.text
    silent = make({})
    assert unsafe_parameters(silent.parameters, ArduPilot()) == []
    assert silent.times()[-1] < 2.2


def test_several_values_are_asked_for_together(make: Make) -> None:
    """Of each pair of names one is enough; what is not told costs as much time as one value."""
    store = make({"OLD": 4.0, "OTHER": 2.0})
    found = store.parameters.known([("NEW", "OLD"), ("OTHER",)])
    assert found == {"OLD": 4.0, "OTHER": 2.0}
    assert store.times()[-1] < 0.1
    assert store.parameters.known([("OTHER",), ("MISSING",)], tries=2) == {"OTHER": 2.0}
    assert [one.param_id for one in store.autopilot.of(READ)].count("MISSING") == 2
    assert store.parameters.known([]) == {}
