"""Hundreds of wheels over broken ground, in C against `section.py`; and what lies at the edge of a patch."""

import ctypes
import dataclasses
import math

import numpy as np
import pytest

from rover_pin.parameters import SOILS
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel, library
from rover_pin.simulation.start.place import Start, hovering
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.section import patches, wheel_frame
from rover_pin.terrain.terrain import HeightGrid, Lanes

FLAT = scenario("flat").model
SOFT = (FLAT.soils[0], SOILS["dry-sand"])
EXPONENTS = [float(soil.n) for soil in SOFT]
HOVER = hovering(FLAT, Start())
R, B = float(FLAT.rover.wheel.r), float(FLAT.rover.wheel.b)
FELT = 1e-9
"""Shares up to here are there or not by the last digit."""


def kernel_on(terrain):
    return Kernel(dataclasses.replace(FLAT, terrain=terrain, soils=SOFT), HOVER.copy(), 0.005, False)


def compiled(kernel, frame, least=FELT):
    """Sinkage of the wheel; of each patch sinkage, share, tilt, turn, side, in-plane normal, normal, soil."""
    sinkage, found = ctypes.c_double(), library().rover_pin_patches
    found.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
    found.restype = ctypes.c_int64
    space = np.concatenate([frame.centre, frame.axle, frame.forward, frame.up])
    rows = kernel.keep["patches"][
        : found(ctypes.addressof(kernel.struct), 0, space.ctypes.data, ctypes.addressof(sinkage))
    ].copy()
    rows[:, -1] = rows[:, -1].view(np.int64)
    return sinkage.value, rows[np.abs(rows[:, 1]) > least]


def plain(terrain, frame):
    found, sinkage = patches(terrain, frame, R, B, EXPONENTS)
    rows = [
        [p.h, p.share, p.tilt, p.turn, p.side, *p.facet.in_plane, *p.facet.normal, p.facet.ground]
        for p in found
        if abs(p.share) > FELT
    ]
    return sinkage, np.array(rows).reshape(-1, 11)


def broken_line(rng, steep):
    x = np.cumsum(rng.uniform(0.004, 0.05, 25)) - 0.3
    z = np.concatenate([[0.0], np.cumsum(np.diff(x) * rng.choice([0.0, 0.2, -0.3, steep, -steep], 24))])
    return Profile(x, z, rng.integers(0, 2, 24))


def broken_grid(rng):
    z = np.add.outer(np.linspace(0.0, 0.1, 14), np.linspace(0.06, 0.0, 9)) + 0.004 * rng.normal(size=(14, 9))
    return HeightGrid(-0.3, -0.2, 0.05, 0.05, z, rng.integers(0, 2, (13, 8)))


def ground(name, rng):
    if name == "grid":
        return broken_grid(rng)
    count = {"a line": 1, "two lanes": 2, "three steep lanes": 3}[name]
    return Lanes(tuple(broken_line(rng, 0.7 * count) for _ in range(count)), (-0.02, 0.015)[: count - 1])


def wheel(rng, terrain):
    yaw, lean = rng.uniform(-math.pi, math.pi) * rng.choice([0.0, 0.05, 1.0]), rng.choice([0.0, 0.3]) * rng.normal()
    x, y = rng.uniform(-0.35, 0.4), rng.uniform(-0.08, 0.08)
    z = terrain.height(x, y) + R - rng.uniform(-0.008, 0.035)
    axle = [-math.sin(yaw) * math.cos(lean), math.cos(yaw) * math.cos(lean), math.sin(lean)]
    return wheel_frame(np.array([x, y, z]), np.array(axle))


@pytest.mark.parametrize("name", ["a line", "two lanes", "three steep lanes", "grid"])
def test_patches_under_many_wheels_are_those_of_the_plain_step(name):
    rng, met = np.random.default_rng(4), 0
    for _ in range(3):
        terrain = ground(name, rng)
        kernel = kernel_on(terrain)
        for _ in range(40):
            frame = wheel(rng, terrain)
            (depth, mine), (reference, theirs) = compiled(kernel, frame), plain(terrain, frame)
            assert depth == pytest.approx(reference, abs=1e-10)
            assert mine.shape == theirs.shape
            assert mine == pytest.approx(theirs, rel=1e-8, abs=1e-8)
            met += len(mine)
    assert met > 150
