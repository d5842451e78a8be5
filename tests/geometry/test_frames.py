"""Frames of reference: conversions undo each other, keep lengths, and agree with known places."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pymap3d
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from aerodaas.geometry.frames import (
    CameraModel,
    GeodeticOrigin,
    Vector,
    body_to_enu,
    enu_to_body,
    enu_to_ned,
    flu_to_frd,
    is_close,
    is_finite,
    ned_to_enu,
    rotation_from_rpy,
    wrap_angle,
    yaw_enu_to_ned,
    yaw_ned_to_enu,
)

metres = st.floats(-5e3, 5e3)
vectors = st.tuples(metres, metres, metres).map(np.array)
angles = st.floats(-20.0, 20.0)
Conversion = Callable[[Vector], Vector]


@given(vectors)
@pytest.mark.parametrize(
    ("there", "back"), [(enu_to_ned, ned_to_enu), (flu_to_frd, flu_to_frd)], ids=["NED", "FRD"]
)
def test_swapping_axes_undoes_itself(there: Conversion, back: Conversion, vector: Vector) -> None:
    """There and back is the identity, and no length changes."""
    np.testing.assert_array_equal(back(there(vector)), vector)
    assert np.linalg.norm(there(vector)) == pytest.approx(np.linalg.norm(vector))


@given(vectors, angles)
def test_turning_into_the_body_undoes_itself(vector: Vector, yaw: float) -> None:
    """ENU to body and back is the identity; height and length stay."""
    body = enu_to_body(vector, yaw)
    np.testing.assert_allclose(body_to_enu(body, yaw), vector, atol=1e-9)
    assert body[2] == vector[2]
    assert np.linalg.norm(body) == pytest.approx(np.linalg.norm(vector))


def test_axes_point_where_they_are_said_to() -> None:
    """East is NED's second axis; a drone that looks north has east to its right."""
    np.testing.assert_array_equal(enu_to_ned(np.array([1.0, 2.0, 3.0])), [2, 1, -3])
    north = math.pi / 2
    np.testing.assert_allclose(
        enu_to_body(np.array([1.0, 0.0, 0.0]), north), [0, -1, 0], atol=1e-12
    )
    assert yaw_enu_to_ned(north) == pytest.approx(0.0)
    assert yaw_enu_to_ned(0.0) == pytest.approx(math.pi / 2)


@given(angles)
def test_wrapping_keeps_the_direction(angle: float) -> None:
    """The same direction, in (-pi, pi]; wrapping twice is wrapping once."""
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
    assert wrap_angle(wrapped) == wrapped


@given(angles)
def test_heading_and_yaw_undo_each_other(yaw: float) -> None:
    """Clockwise from north and counter-clockwise from east, there and back."""
    assert abs(wrap_angle(yaw_ned_to_enu(yaw_enu_to_ned(yaw)) - yaw)) < 1e-9


@given(angles, angles, angles)
def test_rotations_are_rotations(roll: float, pitch: float, yaw: float) -> None:
    """Orthonormal, right-handed, and for a level body the same as turning by its yaw."""
    matrix = rotation_from_rpy(roll, pitch, yaw)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    forward = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(
        rotation_from_rpy(0, 0, yaw) @ forward, body_to_enu(forward, yaw), atol=1e-9
    )


def test_positive_pitch_looks_down_and_positive_roll_lowers_the_right() -> None:
    """The signs that the docstrings promise."""
    assert (rotation_from_rpy(0, 0.3, 0) @ [1, 0, 0])[2] < 0
    assert (rotation_from_rpy(0.3, 0, 0) @ [0, -1, 0])[2] < 0


heights = st.floats(-400, 9000)
far = st.tuples(*[st.floats(-50_000, 50_000)] * 2, st.floats(-100, 3000)).map(np.array)
origins = st.builds(GeodeticOrigin, st.floats(-80, 80), st.floats(-180, 180), st.floats(-100, 3000))


@given(origins, vectors)
def test_geodetic_and_local_undo_each_other(origin: GeodeticOrigin, position: Vector) -> None:
    """Local to geodetic and back is the identity to a tenth of a millimetre."""
    back = origin.to_local(*origin.to_geodetic(position))
    np.testing.assert_allclose(back, position, atol=1e-4)


@given(st.builds(GeodeticOrigin, st.floats(-90, 90), st.floats(-180, 180), heights), far)
def test_geodetic_coordinates_are_those_of_a_library(
    origin: GeodeticOrigin, position: Vector
) -> None:
    """At any place of the earth, poles included, to a hundredth of a millimetre."""
    latitude, longitude, altitude = origin.to_geodetic(position)
    east, north, up = map(float, position)
    lat, lon, alt = map(
        float,
        pymap3d.enu2geodetic(east, north, up, origin.latitude, origin.longitude, origin.altitude),
    )
    apart = pymap3d.geodetic2enu(latitude, longitude, altitude, lat, lon, alt)
    assert math.hypot(*apart) < 1e-5


def test_a_degree_of_latitude_is_110_to_112_kilometres() -> None:
    """North is north, up is up, and the scale is the earth's."""
    origin = GeodeticOrigin(13.0, 77.5, 900.0)
    north = origin.to_local(13.001, 77.5, 900.0)
    assert north[1] == pytest.approx(110.6, abs=0.3)
    assert abs(north[0]) < 1e-6
    np.testing.assert_allclose(origin.to_local(13.0, 77.5, 950.0), [0, 0, 50], atol=1e-6)


cameras = st.builds(
    CameraModel.from_fov,
    st.integers(64, 4000),
    st.integers(48, 3000),
    st.floats(0.3, 2.4),
    mount=st.tuples(*[st.floats(-1, 1)] * 3),
    pitch=st.floats(-1.5, 1.5),
    yaw=st.floats(-3.1, 3.1),
)
share = st.floats(0.0, 1.0)


@given(cameras, share, share, st.floats(0.5, 200.0))
def test_projection_undoes_the_ray(
    camera: CameraModel, across: float, down: float, distance: float
) -> None:
    """A point on the ray through a pixel is seen at that pixel, before the lens."""
    u, v = across * camera.width, down * camera.height
    ray = camera.ray(u, v)
    assert np.linalg.norm(ray) == pytest.approx(1.0)
    seen_u, seen_v, depth = camera.project(np.array(camera.mount) + distance * ray)
    assert seen_u == pytest.approx(u, abs=1e-5 * camera.width)
    assert seen_v == pytest.approx(v, abs=1e-5 * camera.width)
    assert 0 < depth <= distance * (1 + 1e-12)


@given(cameras, vectors)
def test_what_lies_behind_the_lens_has_no_pixel(camera: CameraModel, point: Vector) -> None:
    """A depth that is not positive comes with NaN for the pixel."""
    u, v, depth = camera.project(point)
    assume(abs(depth) > 1e-9)
    assert (math.isnan(u), math.isnan(v)) == ((depth <= 0), (depth <= 0))


def test_the_field_of_view_spans_the_picture() -> None:
    """The edges of the picture are half the field of view away from its middle."""
    camera = CameraModel.from_fov(640, 360, math.radians(90))
    np.testing.assert_allclose(camera.ray(320, 180), [1, 0, 0], atol=1e-12)
    left = camera.ray(0, 180)
    assert math.degrees(math.atan2(left[1], left[0])) == pytest.approx(45.0)


_numbers = st.one_of(st.floats(), st.floats(-1e3, 1e3), st.sampled_from([0.0, -0.0, 1e308, 1e-8]))
_triples = st.tuples(_numbers, _numbers, _numbers).map(np.array)


@given(_triples)
def test_is_finite_agrees_with_numpy(vector: Vector) -> None:
    """The quick test for three numbers gives numpy's answer, NaN and infinities included."""
    assert is_finite(vector) == bool(np.isfinite(vector).all())


@given(
    st.tuples(*[st.floats(-1e6, 1e6)] * 3).map(np.array),
    st.tuples(*[st.sampled_from([0.0, 1e-9, 1e-8, 2e-8, -1e-8, 1e-5, 1.0])] * 3).map(np.array),
    st.sampled_from([0.0, 1e-5, 0.9e-5, 1.1e-5]),
)
def test_is_close_agrees_with_numpy(vector: Vector, shift: Vector, scale: float) -> None:
    """The quick comparison gives that of `numpy.allclose`, up to its very tolerances."""
    other = vector * (1 + scale) + shift
    assert is_close(vector, other) == bool(np.allclose(vector, other))
