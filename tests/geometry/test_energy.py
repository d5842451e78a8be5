"""The energy model and the ways around obstacles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.geometry.energy import EnergyMeter, EnergyModel
from aerodaas.geometry.free_path import free_path
from aerodaas.messages.waypoints import Waypoint

HOME = np.zeros(3)


def test_hover_empties_the_battery_in_its_endurance() -> None:
    """By definition of the model's scale."""
    assert EnergyModel(endurance=600.0).hover(600.0) == pytest.approx(1.0)


def test_power_has_the_known_shape() -> None:
    """Less than in hover at moderate speed, far more when fast; climbing costs (Zeng 2019)."""
    model = EnergyModel()
    power = [model.power(np.array([v, 0.0, 0.0])) for v in (0, 10, 30)]
    assert power[0] == pytest.approx(1.0)
    assert power[1] < 0.9
    assert power[2] > 2.0
    assert model.power(np.array([0.0, 0.0, 2.0])) == pytest.approx(1.26, abs=0.01)
    assert model.power(np.array([0.0, 0.0, -2.0])) == pytest.approx(1.0)


@given(st.lists(st.tuples(*[st.floats(-1e200, 1e200) | st.floats(-30, 30)] * 3), min_size=1))
def test_the_power_of_one_velocity_is_that_of_many(
    velocities: list[tuple[float, float, float]],
) -> None:
    """By number and by array the same, and nothing raises, however large a number."""
    model, many = EnergyModel(wind=np.array([3.0, -2.0, 0.5])), np.array(velocities)
    with np.errstate(all="ignore"):
        one_by_one = [model.power(velocity) for velocity in many]
        np.testing.assert_array_equal(one_by_one, model.powers(many))


def test_a_head_wind_costs() -> None:
    """The same leg, against strong wind and with it."""
    model = EnergyModel(wind=np.array([-12.0, 0.0, 0.0]))
    there, back = np.array([100.0, 0.0, 0.0]), HOME
    assert model.leg(back, there, 8.0) > 1.15 * model.leg(there, back, 8.0)


@given(st.lists(st.tuples(*[st.floats(-100, 100)] * 3, st.floats(0, 30)), max_size=6))
def test_hovers_add_up_along_a_route(
    stops: list[tuple[float, float, float, float]],
) -> None:
    """Charges add up and are never negative."""
    model = EnergyModel()
    route = [Waypoint(f"w{i}", x, y, abs(z), hover) for i, (x, y, z, hover) in enumerate(stops)]
    charge = model.route(HOME, route, HOME, 2.0)
    assert charge >= sum(model.hover(w.hover_duration) for w in route) - 1e-12
    longer = [replace(w, hover_duration=w.hover_duration + 1.0) for w in route]
    added = model.route(HOME, longer, HOME, 2.0) - charge
    assert added == pytest.approx(model.hover(float(len(route))))


def test_the_meter_scales_what_it_sees() -> None:
    """A battery that drains twice as fast doubles what the way home needs; hope is not added."""
    model = EnergyModel(endurance=900.0)
    worn, fresh = EnergyMeter(model), EnergyMeter(model)
    for second in range(120):
        worn.observe(1.0 - second * 2 / 900, HOME, 1.0)
        fresh.observe(1.0 - second * 0.5 / 900, HOME, 1.0)
    assert worn.scale == pytest.approx(2.0, rel=0.02)
    assert fresh.scale == 1.0
    away = np.array([50.0, 0.0, 10.0])
    assert worn.way_home(away, HOME, 2.0) == pytest.approx(
        worn.scale * model.way_home(away, HOME, 2.0)
    )


def test_free_path_is_the_shortest_way_round() -> None:
    """Around a block: by its near corners, as long as geometry says."""
    area = shapely.box(0, 0, 20, 20).difference(shapely.box(8, -1, 12, 15))
    path = free_path(area, (0.0, 0.0), (20.0, 0.0))
    assert path is not None
    assert path == [(0.0, 0.0), (8.0, 15.0), (12.0, 15.0), (20.0, 0.0)]
    assert math.dist(path[0], path[1]) == pytest.approx(17.0)
    assert free_path(area, (0.0, 0.0), (5.0, 20.0)) == [(0.0, 0.0), (5.0, 20.0)]
    divided = shapely.box(0, 0, 20, 20).difference(shapely.box(8, -1, 12, 21))
    assert free_path(divided, (0.0, 0.0), (20.0, 0.0)) is None
