"""Parameters of an autopilot: asked until they are told, set until they show to be set."""

from __future__ import annotations

import contextlib
import queue
from collections import deque
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices import parameters as module
from aerodaas.drivers.mavlink.microservices.parameters import Parameters, unsafe_parameters
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.errors import VehicleError

INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


class Autopilot:
    """Holds parameters and tells them; of `deaf` words it hears none."""

    target = (7, 1)

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, held: dict[str, float], kind: int = REAL32
    ) -> None:
        self.now = 100.0
        self.held = held
        self.kind = kind
        self.deaf = 0
        self.stubborn = False
        self.noise: list[Any] = []
        self.sent: list[Any] = []
        self.at: list[float] = []
        self._inbox: deque[Any] = deque()
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))

    @contextlib.contextmanager
    def listen(self, name: str) -> Iterator[Autopilot]:
        """Its answers."""
        assert name == "PARAM_VALUE"
        self._inbox.clear()
        yield self

    def get(self, timeout: float) -> Any:  # noqa: ANN401 - pymavlink has no types
        """The next of them, or silence."""
        if not self._inbox:
            self.now += timeout
            raise queue.Empty
        self.now += 0.01
        return self._inbox.popleft()

    def send(self, message: Any) -> None:  # noqa: ANN401
        """Hear one word."""
        self.sent.append(message)
        self.at.append(round(self.now, 3))
        self.deaf -= 1
        if self.deaf >= 0:
            return
        self._inbox += self.noise
        name = message.param_id
        if message.get_type() == "PARAM_SET" and not self.stubborn:
            self.held[name] = message.param_value
        if name in self.held:
            self._inbox.append(self.told(name, self.held[name]))

    def told(self, name: str, value: float) -> Any:  # noqa: ANN401
        """A value on the wire."""
        return mavlink.MAVLink_param_value_message(name.encode(), value, self.kind, 9, 1)

    @property
    def parameters(self) -> Parameters:
        """The driver's side."""
        return Parameters(self, ArduPilot())  # type: ignore[arg-type]

    def kinds(self) -> list[str]:
        """What was said to it."""
        return [one.get_type() for one in self.sent]


def test_a_value_is_asked_for_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the vehicle; others that come meanwhile are not it."""
    autopilot = Autopilot(monkeypatch, {"FENCE": 5.0, "ZERO": 0.0})
    autopilot.noise = [autopilot.told("FENCE_TYPE", 9.0), autopilot.told("FENC", 8.0)]
    assert autopilot.parameters.get("FENCE") == 5.0
    assert autopilot.parameters.get("ZERO") == 0.0
    request = autopilot.sent[0]
    assert request.get_type() == "PARAM_REQUEST_READ"
    assert (request.target_system, request.target_component) == (7, 1)
    assert (request.param_id, request.param_index) == ("FENCE", -1)


def test_what_is_not_told_is_asked_for_four_times(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each 0.7 s; the fourth time may be the one that is heard."""
    autopilot = Autopilot(monkeypatch, {"FENCE": 5.0})
    autopilot.deaf = 3
    assert autopilot.parameters.get("FENCE") == 5.0
    assert autopilot.at == [100.0, 100.7, 101.4, 102.1]
    autopilot.deaf = 4
    assert autopilot.parameters.get("FENCE") is None
    assert len(autopilot.sent) == 8
    assert autopilot.now == pytest.approx(104.91)


def test_others_that_go_on_talking_do_not_make_it_wait_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """100 of them for each request, a hundredth of a second apart."""
    autopilot = Autopilot(monkeypatch, {})
    autopilot.noise = [autopilot.told("OTHER", 1.0)] * 100
    assert autopilot.parameters.get("FENCE") is None
    assert autopilot.at == pytest.approx([100.0, 100.7, 101.4, 102.1], abs=0.05)


def test_a_value_is_set_and_seen_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read first; what it is already is not set."""
    autopilot = Autopilot(monkeypatch, {"FENCE": 5.0})
    autopilot.parameters.set("FENCE", 5.0)
    assert autopilot.kinds() == ["PARAM_REQUEST_READ"]
    autopilot.parameters.set("FENCE", 6.5)
    assert autopilot.held["FENCE"] == 6.5
    assert autopilot.kinds()[1:] == ["PARAM_REQUEST_READ", "PARAM_SET"]
    said = autopilot.sent[-1]
    assert (said.target_system, said.target_component) == (7, 1)
    assert (said.param_id, said.param_value, said.param_type) == ("FENCE", 6.5, REAL32)


def test_an_integer_of_px4_travels_by_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """There and back; 3 is 4.2e-45 to whoever reads a single."""
    px4 = PX4()
    autopilot = Autopilot(monkeypatch, {"GF_ACTION": px4.encode(1.0, INT32)}, INT32)
    parameters = Parameters(autopilot, px4)  # type: ignore[arg-type]
    assert parameters.get("GF_ACTION") == 1.0
    parameters.set("GF_ACTION", 3.0)
    assert 0.0 < autopilot.held["GF_ACTION"] < 1e-40
    assert autopilot.sent[-1].param_type == INT32
    assert parameters.get("GF_ACTION") == 3.0


@pytest.mark.parametrize(
    ("held", "wanted", "same"),
    [
        (1.0, 1.00001, True),
        (1.0, 1.00002, False),
        (0.0, 0.00001, True),
        (0.0, -0.00002, False),
        (10000.0, 10000.09, True),
        (10000.0, 10000.2, False),
        (-10000.0, -10000.09, True),
    ],
)
def test_singles_are_the_same_to_five_digits(
    monkeypatch: pytest.MonkeyPatch, held: float, wanted: float, *, same: bool
) -> None:
    """A hundred-thousandth of the value, or of one where that is more."""
    autopilot = Autopilot(monkeypatch, {"FENCE": held})
    autopilot.parameters.set("FENCE", wanted)
    assert ("PARAM_SET" not in autopilot.kinds()) is same


def test_what_is_not_set_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that it does not know, a value that stays, and silence afterwards."""
    autopilot = Autopilot(monkeypatch, {})
    with pytest.raises(VehicleError, match="knows no parameter FENCE"):
        autopilot.parameters.set("FENCE", 1.0)
    assert "PARAM_SET" not in autopilot.kinds()
    autopilot = Autopilot(monkeypatch, {"FENCE": 2.0})
    autopilot.stubborn = True
    with pytest.raises(VehicleError, match="did not set FENCE to 3: it is 2"):
        autopilot.parameters.set("FENCE", 3.0)
    assert autopilot.kinds().count("PARAM_SET") == 4
    autopilot = Autopilot(monkeypatch, {"FENCE": 2.0})
    parameters, heard = autopilot.parameters, autopilot.send

    def dies(message: Any) -> None:  # noqa: ANN401
        if message.get_type() == "PARAM_SET":
            autopilot.deaf = 100
        heard(message)

    monkeypatch.setattr(autopilot, "send", dies)
    with pytest.raises(VehicleError, match="did not set FENCE to 3: nothing is known of it"):
        parameters.set("FENCE", 3.0)


def test_a_set_whose_answer_got_lost_is_found_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read again before it is called a failure."""
    autopilot = Autopilot(monkeypatch, {"FENCE": 2.0})
    heard = autopilot.send

    def silent(message: Any) -> None:  # noqa: ANN401
        if message.get_type() == "PARAM_SET":
            autopilot.held["FENCE"] = message.param_value
            autopilot.deaf = 1
        heard(message)

    monkeypatch.setattr(autopilot, "send", silent)
    autopilot.parameters.set("FENCE", 3.0)
    assert autopilot.kinds()[-1] == "PARAM_REQUEST_READ"


@pytest.mark.parametrize(("letters", "known"), [(16, True), (17, False)])
def test_a_name_has_sixteen_letters_at_most(
    monkeypatch: pytest.MonkeyPatch, letters: int, *, known: bool
) -> None:
    """A longer one would be another parameter's."""
    autopilot = Autopilot(monkeypatch, {"A" * letters: 1.0})
    if known:
        assert autopilot.parameters.get("A" * letters) == 1.0
    else:
        with pytest.raises(VehicleError, match="no parameter's name is as long as 'AAAA"):
            autopilot.parameters.get("A" * letters)


def test_a_name_with_letters_that_no_autopilot_has_is_not_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is asked for all the same."""
    autopilot = Autopilot(monkeypatch, {})
    assert autopilot.parameters.get("HÖHE") is None
    assert autopilot.sent[0].param_id == "H?HE"


def test_what_leaves_a_vehicle_unprotected(monkeypatch: pytest.MonkeyPatch) -> None:
    """By its value; what is not known is not told."""
    parameters = Autopilot(monkeypatch, {"BATT_FS_LOW_ACT": 0.0, "FS_EKF_ACTION": 1.0}).parameters
    (one,) = unsafe_parameters(parameters, ArduPilot())
    assert (one.failsafe.name, one.failsafe.safe, one.value) == ("BATT_FS_LOW_ACT", 2.0, 0.0)
    words = "BATT_FS_LOW_ACT is 0, so that a low battery only leads to a warning; 2 is safer"
    assert one.text == words
    silent = Autopilot(monkeypatch, {"FS_EKF_ACTION": 0.0}).parameters
    (one,) = unsafe_parameters(silent, ArduPilot())
    assert one.failsafe.name == "FS_EKF_ACTION"


def test_failsafes_cost_the_time_of_one_value(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that a vehicle does not know do not add up, nor do other parameters' values."""
    autopilot = Autopilot(monkeypatch, {})
    assert unsafe_parameters(autopilot.parameters, ArduPilot()) == []
    assert autopilot.now <= 102.9
    assert len({one.param_id for one in autopilot.sent}) == len(ArduPilot.failsafes)


def test_several_values_are_asked_for_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each pair of names one is enough; what is not told costs as much time as one value."""
    autopilot = Autopilot(monkeypatch, {"OLD": 4.0, "OTHER": 2.0})
    found = autopilot.parameters.known([("NEW", "OLD"), ("OTHER",)])
    assert found == {"OLD": 4.0, "OTHER": 2.0}
    assert autopilot.now < 100.1
    assert autopilot.parameters.known([("OTHER",), ("MISSING",)], tries=2) == {"OTHER": 2.0}
    assert autopilot.now == pytest.approx(101.4, abs=0.1)
    assert [one.param_id for one in autopilot.sent].count("MISSING") == 2
    assert [one.param_id for one in autopilot.sent].count("OTHER") == 2
    before = autopilot.now
    assert autopilot.parameters.known([]) == {}
    assert autopilot.now == before
