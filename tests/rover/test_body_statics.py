"""Static wheel loads: sums, moments, symmetry, known cases, and rovers that cannot stand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads

NEXUS6 = load_rover("nexus6")
WEIGHT = 5.8 * 9.81
angles = st.floats(-0.4, 0.4)


@settings(max_examples=25, deadline=None)
@given(angles, angles)
def test_loads_carry_the_weight_across_the_plane(slope, side):
    loads = wheel_loads(NEXUS6, slope, side)
    assert loads.sum() == pytest.approx(WEIGHT * math.cos(slope) * math.cos(side), rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(angles, angles)
def test_the_moments_about_the_centre_of_mass_balance(slope, side):
    """By hand: vertical forces at the lowest points, the weight at the centre of mass; positions from the URDF."""
    loads = wheel_loads(NEXUS6, slope, side)
    places = np.array([[x, y, -0.13] for x in (0.15, 0.0, -0.15) for y in (0.16, -0.16)])
    gravity = rotation(slope, side).T @ [0.0, 0.0, -1.0]
    model = NEXUS6.model
    centre = pin.centerOfMass(model, model.createData(), pin.neutral(model))
    forces = -np.outer(loads / -gravity[2], gravity)
    moment = np.cross(places - centre, forces).sum(axis=0)
    assert np.allclose(moment, 0.0, atol=1e-9)


def rotation(slope, side):
    c, s, d, t = math.cos(slope), math.sin(slope), math.cos(side), math.sin(side)
    return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ np.array([[1, 0, 0], [0, d, -t], [0, t, d]])


def test_without_its_differential_the_rover_cannot_stand():
    loose = dataclasses.replace(NEXUS6, differential=None)
    with pytest.raises(ParameterError, match="'nexus6'"):
        wheel_loads(loose, 0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((2.0,), r"slope = 114.592.*\[-80, 80\]"),
        ((0.0, float("nan")), "side_slope = nan"),
        ((0.0, 0.0, 0.0), "gravity = 0 m/s.2"),
        ((0.0, 0.0, 100.1), "gravity = 100.1 m/s.2"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ParameterError, match=words):
        wheel_loads(NEXUS6, *arguments)


def test_four_wheels_on_a_rigid_body_take_the_least_norm():
    """Statically indeterminate: twisting the load pattern (+ - - +) balances too, and the answer has none of it."""
    loads = wheel_loads(load_rover("cart"), 0.1, 0.15)
    assert abs(loads @ [1.0, -1.0, -1.0, 1.0]) < 1e-9 * loads.sum()
