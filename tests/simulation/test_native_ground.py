"""The contact geometry in C is compared with `section.py`, which shares no code with it, on random polylines, lanes and
grids.
"""

from __future__ import annotations

import ctypes
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin import SOILS, scenario
from rover_pin.simulation.compiled.kernel import Kernel, library
from rover_pin.simulation.start import Start, hovering
from rover_pin.terrain.section import patches, wheel_frame
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile

FLAT = scenario("flat").model
SOFT = (FLAT.soils[0], SOILS["dry-sand"])
HOVER = hovering(FLAT, Start())
R, B = float(FLAT.rover.wheel.r), float(FLAT.rover.wheel.b)
TOUCH = 1e-8
"""Patches shallower [m], or of less of a plane, are there or not by the last digit."""
EXPONENTS = [float(soil.n) for soil in SOFT]


def compiled_patches(kernel, frame):
    """Return the patches with the columns sinkage, share, tilt, turn, side, in-plane normal (2), normal (3) and soil,
    and the sinkage of the wheel.
    """
    sinkage = ctypes.c_double()
    compiled = library().rover_pin_patches
    compiled.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
    compiled.restype = ctypes.c_int64
    space = np.concatenate([frame.centre, frame.axle, frame.forward, frame.up])
    count = compiled(ctypes.addressof(kernel.struct), 0, space.ctypes.data, ctypes.addressof(sinkage))
    rows = kernel.keep["patches"][:count].copy()
    rows[:, -1] = rows[:, -1].view(np.int64)
    return rows, sinkage.value


def plain_patches(terrain, frame):
    patch_list, sinkage = patches(terrain, frame, R, B, EXPONENTS)
    rows = [
        [
            patch.h,
            patch.share,
            patch.tilt,
            patch.turn,
            patch.side,
            *patch.facet.in_plane,
            *patch.facet.normal,
            patch.facet.ground,
        ]
        for patch in patch_list
    ]
    return np.array(rows).reshape(-1, 11), sinkage


def felt(rows):
    return rows[(rows[:, 0] > TOUCH) & (np.abs(rows[:, 1]) > TOUCH)]


def agree(terrain, frame):
    """Compare both geometries, and return the number of patches."""
    changed_flat = dataclasses.replace(FLAT, terrain=terrain, soils=SOFT)
    (mine, depth), (theirs, reference) = (
        compiled_patches(Kernel(changed_flat, HOVER.copy(), 0.005, False), frame),
        plain_patches(terrain, frame),
    )
    mine, theirs = felt(mine), felt(theirs)
    assert depth == pytest.approx(reference, abs=1e-10)
    assert mine.shape == theirs.shape
    assert mine == pytest.approx(theirs, rel=1e-9, abs=1e-9)
    return len(mine)


@st.composite
def profiles(draw, soils=2):
    """Return polylines with steep and level pieces, straight pieces that are divided into many, and several soils."""
    gaps = draw(st.lists(st.floats(0.002, 0.08), min_size=1, max_size=12))
    slopes = draw(st.lists(st.sampled_from([0.0, 0.0, 0.3, -0.3, 1.5, -4.0]), min_size=len(gaps), max_size=len(gaps)))
    ground = draw(st.lists(st.integers(0, soils - 1), min_size=len(gaps), max_size=len(gaps)))
    cuts = draw(st.integers(1, 9))
    x = -0.15 + np.concatenate([[0.0], np.cumsum(gaps)])
    z = np.concatenate([[0.0], np.cumsum(np.array(slopes) * np.diff(x))])
    dense = np.interp(np.arange((len(x) - 1) * cuts + 1) / cuts, np.arange(len(x)), x)
    return Profile(dense, np.interp(dense, x, z), np.repeat(ground, cuts))


def frames(terrain, draw):
    """Return wheels near the ground with random headings and tilts."""
    yaw, lean = draw(st.floats(-math.pi, math.pi)), draw(st.just(0.0) | st.floats(-0.4, 0.4))
    x, y = draw(st.floats(-0.3, 0.6)), draw(st.floats(-0.1, 0.1))
    z = terrain.height(x, y) + R - draw(st.floats(-0.01, 0.03))
    axle = [-math.sin(yaw) * math.cos(lean), math.cos(yaw) * math.cos(lean), math.sin(lean)]
    return wheel_frame(np.array([x, y, z]), np.array(axle))


@settings(max_examples=30)
@given(st.data())
def test_lanes_in_c_are_those_of_the_plain_step(data):
    lanes = data.draw(st.integers(1, 3))
    terrain = Lanes(tuple(data.draw(profiles()) for _ in range(lanes)), (-0.02, 0.015)[: lanes - 1])
    agree(terrain, frames(terrain, data.draw))


@settings(max_examples=30)
@given(st.data())
def test_a_grid_in_c_is_that_of_the_plain_step(data):
    shape = (data.draw(st.integers(2, 9)), data.draw(st.integers(2, 6)))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    rough = data.draw(st.sampled_from([0.0, 0.01]))
    slope = np.add.outer(0.2 * np.arange(shape[0]), -0.1 * np.arange(shape[1])) * 0.05
    cells = rng.integers(0, 2, (shape[0] - 1, shape[1] - 1)) if rough else 0
    terrain = HeightGrid(-0.1, -0.12, 0.05, 0.05, slope + rng.normal(0.0, rough, shape), cells)
    agree(terrain, frames(terrain, data.draw))


@pytest.mark.parametrize("border", ["x low", "x high", "y low", "y high"])
def test_a_grid_ends_in_c_where_it_ends_in_the_plain_step(border):
    """Wheels with random headings move over the last cell and beyond, in steps of 2 mm. The slope continues up to the
    last point.
    """
    z = np.add.outer(0.3 * np.arange(6), -0.2 * np.arange(5)) * 0.05
    terrain = HeightGrid(-0.1, -0.12, 0.05, 0.05, z, 0)
    axle = np.array([-math.sin(0.7) * math.cos(0.2), math.cos(0.7) * math.cos(0.2), math.sin(0.2)])
    ends = {"x low": -0.1, "x high": 0.15, "y low": -0.12, "y high": 0.08}
    for off in np.arange(-0.03, 0.031, 0.002):
        x, y = (ends[border] + off, 0.0) if border.startswith("x") else (0.0, ends[border] + off)
        assert agree(terrain, wheel_frame(np.array([x, y, terrain.height(x, y) + R - 0.01]), axle)) > 0


@pytest.mark.parametrize("spacing", ["even", "crowded"])
def test_a_place_is_found_in_thousands_of_points(spacing):
    rng = np.random.default_rng(2)
    x = np.linspace(-0.5, 1.5, 3_000)
    if spacing == "crowded":
        x = np.sort(np.concatenate([rng.uniform(0.2, 0.21, 300), rng.uniform(-0.5, 1.5, 700)]))
    terrain = Lanes((Profile(x, 0.004 * np.sin(40.0 * x)),))
    for at in (-1.0, -0.5, 0.0, 0.195, 0.205, 0.3, 1.5, 2.5):
        frame = wheel_frame(np.array([at, 0.0, terrain.height(at, 0.0) + R - 0.008]), np.array([0.0, 1.0, 0.0]))
        assert agree(terrain, frame) >= (1 if abs(at - 0.5) >= 1.0 else 9)
