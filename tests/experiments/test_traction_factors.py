"""Traction factors as an experiment: the soil's own functions, derivatives, errors in both axes and shared errors."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.contact import Soil, Wheel
from rover_pin.discrepancy.experiment import Parts
from rover_pin.experiments.traction_factors import TractionFactors
from rover_pin.loop.identify import identify
from rover_pin.measurements.traction_points import TractionPoints, read_traction_points
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.sinkage import entry_angle
from rover_pin.soil.wheel_forces import NetTraction, load_traction_factor

SLIPS, SOIL, WHEEL = np.linspace(0.02, 0.9, 12), Soil(k=0.008), Wheel()
HELD = {name: float(getattr(SOIL, name)) for name in ("c", "n", "theta_1", "theta_2")} | {"k_1": float(SOIL.k_1)}
SIZES = {"r": float(WHEEL.r), "b": float(WHEEL.b)}


def curve(S, soil=SOIL, form=NetTraction()):
    return np.array([float(load_traction_factor(float(s), soil, WHEEL, form)) for s in S])


def factors(slip=SLIPS, factor=None, sd=0.006, soil=SOIL, **errors):
    points = TractionPoints(slip, curve(slip) if factor is None else factor, sd, **errors)
    return TractionFactors(points, Parts({"soil": soil, "wheel": WHEEL}))


def test_a_loaded_wheel_stands_on_the_arc_that_carries_it():
    load = np.linspace(5.0, 15.0, len(SLIPS))
    bench = factors(angles=SinkageAngles(), load=load)
    carried = [
        load_traction_factor(
            S, SOIL.replace(theta_1=entry_angle(W, S, WHEEL, SOIL)), WHEEL, NetTraction(), SinkageAngles()
        )
        for S, W in zip(SLIPS, load, strict=True)
    ]
    assert bench.predict([bench.base_model()])[0].ravel() == pytest.approx(list(map(float, carried)), rel=1e-9)
    assert {"soil.k_1", "soil.exit_ratio"} <= {number.name for number in bench.uncertain(bench.base_model())}


ERRORS = {"slip_sd": 0.02, "shared": 0.03 * SLIPS, "slip_shared": 0.015}


def test_slopes_are_the_derivatives_of_every_number():
    bench = factors(**ERRORS)
    model = bench.base_model()
    numbers = bench.uncertain(model)
    u = np.linspace(0.1, 0.4, len(numbers))
    slopes = bench.sensitivities(model, numbers, u).slopes
    for place, number in enumerate(numbers):
        step = np.eye(len(numbers))[place] * 1e-5
        ends = [bench.sensitivities(model, numbers, u + sign * step).predicted for sign in (1, -1)]
        assert slopes[place] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-7), number.name


def test_noiseless_points_return_k_and_phi_from_another_soil():
    identification = identify(factors(soil=Soil(k=0.05, phi=0.7)), fixed={**HELD, **SIZES})
    assert identification["k"].number.value == pytest.approx(0.008, rel=0.01)
    assert identification["phi"].number.value == pytest.approx(float(SOIL.phi), rel=0.01)
    assert identification.found == ("soil.phi", "soil.k")


def test_a_wheel_that_is_held_is_the_one_that_is_predicted():
    """Without cohesion the factor is one of r / k alone: of a wheel twice as large k is twice as large."""
    bench = factors(soil=SOIL.replace(c=0.0))
    sizes = {**HELD, **SIZES, "c": 0.0}
    k, larger = (identify(bench, fixed={**sizes, "r": r})["k"].number.value for r in (SIZES["r"], 2.0 * SIZES["r"]))
    assert larger == pytest.approx(2.0 * k, rel=0.02)


def test_stated_intervals_hold_the_truth():
    """k and phi of a curve that tells them, 30 times with noise as stated: 95 % of 60, three SDs of a count below."""
    draw, covered = np.random.default_rng(8), []
    for _ in range(30):
        bench = factors(factor=curve(SLIPS) + 0.006 * draw.normal(size=len(SLIPS)))
        identification = identify(bench, fixed={**HELD, **SIZES})
        for name in ("k", "phi"):
            covered.append(
                identification[name].number.low <= float(getattr(SOIL, name)) <= identification[name].number.high
            )
    assert np.mean(covered) >= 0.86


@pytest.mark.slow
def test_a_noisy_slip_does_not_flatten_the_curve():
    """Slips off by 0.04 (1 SD) on the steep part: taken as exact, the median fit has 0.6 of the true k."""
    slips, random = np.tile(np.linspace(0.0, 0.3, 8), 6), np.random.default_rng(5)
    off, covered = {0.04: [], 0.0: []}, 0
    for _ in range(12):
        slip = slips + 0.04 * random.standard_normal(48)
        factor = curve(slips) + 0.005 * random.standard_normal(48)
        for sd, logs in off.items():
            k = identify(factors(slip, factor, 0.005, slip_sd=sd), fixed={**HELD, **SIZES})["k"].number
            logs.append(math.log(k.value / float(SOIL.k)))
            covered += sd > 0 and k.low < float(SOIL.k) < k.high
    right, wrong = (abs(np.median(logs)) for logs in off.values())
    assert right < 0.5 * wrong, off
    assert covered >= 9, off


def test_a_shared_error_widens_phi_more_than_k():
    """Thrust goes with tan phi: a factor on all F is mostly a change of phi."""
    plain, wide = (
        identify(factors(shared=shared_error), fixed={**HELD, **SIZES}) for shared_error in (0.0, 0.05 * curve(SLIPS))
    )
    width = {
        name: [
            math.log(identification[name].number.high / identification[name].number.low)
            for identification in (plain, wide)
        ]
        for name in ("k", "phi")
    }
    assert width["phi"][1] > 1.5 * width["phi"][0]
    assert width["k"][1] / width["k"][0] < width["phi"][1] / width["phi"][0]
    assert wide["phi"].prior_shares["points.common_factor"] > 0.3


def test_errors_are_checked(tmp_path):
    with pytest.raises(DataError, match=r"slip_sd.*row 1 \(-0.1\)"):
        factors(slip_sd=-0.1)
    with pytest.raises(DataError, match="different lengths"):
        factors(shared=[0.1, 0.2])
    file = tmp_path / "points.csv"
    file.write_text("slip,traction_factor,sd,slip_sd\n0.1,0.1,0.01,0.02\n0.4,0.2,0.01,0.03\n")
    assert read_traction_points(file).slip_sd == pytest.approx([0.02, 0.03])
    assert len(identify(file).estimates) > 2
