"""A wheel with lugs in its trench, driving, braking and locked: whatever a bracket finds to carry it is found."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.errors import DataError
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
RIM = 0.05


def carried(y, S, wheel, soil):
    """Return f_n of Eqs (2)-(6) by plain quadrature in theta, at the sinkage y into the trench's floor."""
    r, b = wheel.r, wheel.b
    first = math.acos(1.0 - y / r)
    last = -soil.exit_ratio * first
    theta = 0.5 * (first + last) + 0.5 * (first - last) * NODES
    sigma = (soil.k_1 + soil.k_2 * b) * (r / b) ** soil.n * np.maximum(np.cos(theta) - math.cos(first), 0.0) ** soil.n
    travel = 1.0 - S if S >= 0 else 1.0 / max(1.0 + S, 1e-14)
    slid = r * ((first - theta) - travel * (math.sin(first) - np.sin(theta)))
    tau = (soil.c + sigma * math.tan(soil.phi)) * np.sign(slid) * -np.expm1(-np.abs(slid) / soil.k)
    return 0.5 * (first - last) * r * b * float(WEIGHTS @ (sigma * np.cos(theta) + tau * np.sin(theta)))


def missing(y, load, *rest):
    """Return what f_n has beyond the load."""
    return carried(y, *rest) - load


def trench(S, wheel, lugs, y):
    """Return how deep lugs dig where what they carry off, E h_l (r omega - v) (1 - 2 D / r), is what comes in, D v."""
    travel, rim = RIM * (1.0 - max(S, 0.0)), RIM * (1.0 + min(S, 0.0))
    away = lugs.h_l * lugs.filled * max(rim - travel, 0.0) * min(y / 1e-4, 1.0)
    return away / (travel + 2.0 * away / wheel.r)


def drawn(random):
    """Return a wheel, its lugs, a soil, a slip and a sinkage into the floor, from ranges of this test's own."""
    r = random.uniform(0.03, 0.3)
    wheel = Wheel(r=r, b=r * random.uniform(0.3, 1.6))
    soil = Soil(
        k=float(np.exp(random.uniform(math.log(1e-3), math.log(0.1)))),
        phi=math.radians(random.uniform(15.0, 45.0)),
        c=random.choice([0.0, random.uniform(0.0, 4000.0)]),
        n=random.uniform(0.5, 1.5),
        exit_ratio=random.uniform(-0.1, 0.5),
        k_1=float(np.exp(random.uniform(math.log(1e4), math.log(3e6)))),
    )
    lugs = LugExcavation(h_l=min(random.uniform(0.0, 0.3) * r, 0.05), filled=random.uniform(0.2, 1.5))
    S = float(random.choice([random.uniform(-0.95, 0.0), random.uniform(0.0, 0.97), 1.0, -1.0], p=[0.3, 0.5, 0.1, 0.1]))
    return wheel, lugs, soil, S, r * float(np.exp(random.uniform(math.log(1e-3), math.log(0.8))))


def test_no_lugged_wheel_that_a_bracket_carries_is_lost():
    """1,500 conditions: Newton's method ends where an independent bracketing root does, or says that none is."""
    random, beyond, count = np.random.default_rng(2511), 0, 0
    while count < 1500:
        wheel, lugs, soil, S, y = drawn(random)
        load = carried(y, S, wheel, soil)
        if not 0.0 < load < carried(wheel.r, S, wheel, soil):
            continue  # braked on cohesive soil the ground pulls a shallow wheel down: more roots than one
        count += 1
        y = brentq(missing, 1e-9 * wheel.r, wheel.r, args=(load, S, wheel, soil))
        h = y + trench(S, wheel, lugs, y)
        model = RigModel(wheel, soil, (*PAPER, lugs))
        if h > wheel.r:
            beyond += 1
            with pytest.raises(DataError, match="no sinkage down to the axle carries"):
                model.predict(load, S)
            continue
        assert model.predict(load, S).sinkage[0] == pytest.approx(h, rel=0.02 if S < 0 else 1e-3)
    assert 0 < beyond < 100
