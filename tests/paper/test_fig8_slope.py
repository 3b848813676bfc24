"""What the paper's text says of Fig 8, a slope with increasing inclination, against the three forms of Table 1.

Its words, of the experiment: "the slip ratio stays near 0 before t = 25 [s]", "at t = 25 [s], the inclination of the
slope reaches almost 12 degrees"; of the simulation: "the slip ratio switches from 0 to 1 at the inclination of 12
degrees, same as the experiment" and "the elevation keeps rising after switching the value of the slip". The slope grows
by 10 deg/m here, so that 0.05 m/s reaches 12 deg about 25 s after its foot. Disagreements are strict xfails.
"""

import math

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario

RATE, START = math.radians(10.0), 0.5
TWELVE = 12.0
ABRUPT = {"soil.k": 0.001, "soil.phi_deg": 13.7, "effect.MotionResistance.R": 0.03}


@pytest.fixture(scope="module")
def traces():
    scenarios = {
        form: scenario("slope", soil="table-1", form=form, duration=80.0).drive() for form in ("net", "torque", "gross")
    }
    return {**scenarios, "abrupt": scenario("slope", soil="table-1", **ABRUPT, duration=60.0).drive()}


def inclination(trace):
    return np.degrees(np.clip(RATE * (trace["body_x"] - START), 0.0, math.radians(20.0)))


def slip_at(trace, degrees):
    """Return the slip where the body first reaches this inclination; if it never does, the slip at the end."""
    there = np.flatnonzero(inclination(trace) >= degrees)
    return trace["slip_ml"][there[0] if there.size else -1]


def degrees_at(trace, slip):
    """Return the inclination from which on the slip is above this value."""
    below = np.flatnonzero(trace["slip_ml"] <= slip)
    first = 0 if below.size == 0 else below[-1] + 1
    return inclination(trace)[first] if first < len(trace.t) else math.inf


def differs(form, measured):
    return pytest.param(form, marks=pytest.mark.xfail(strict=True, reason=measured), id=form)


@pytest.mark.parametrize(
    "form",
    [
        differs("net", "S = 0.99 on the flat: Table 1 gives no pull"),
        differs("torque", "S = 0.5 at 4.6 deg, 0.84 at 7.5 deg"),
        differs("gross", "S = 0.5 at 4.5 deg, 0.85 at 7.5 deg"),
        "abrupt",
    ],
)
def test_the_slip_stays_near_0_on_gentle_slopes(traces, form):
    """ "Near 0" is read as below 0.2, for slopes up to 10 deg of the 12 deg."""
    assert abs(slip_at(traces[form], 10.0)) < 0.2


@pytest.mark.parametrize(
    "form",
    [
        differs("net", "it does not leave the flat"),
        differs("torque", "0.1 at 0 deg, 0.9 at 8.0 deg"),
        differs("gross", "0.1 at 0 deg, 0.9 at 8.0 deg"),
        "abrupt",
    ],
)
def test_the_slip_switches_from_0_to_1_at_12_degrees(traces, form):
    """The slip rises from 0.1 to 0.9 within 2 deg and ends at 12 deg. An invented sand with small k and phi shows the
    required soil.
    """
    low, high = (degrees_at(traces[form], slip) for slip in (0.1, 0.9))
    assert high == pytest.approx(TWELVE, abs=0.5)
    assert high - low < 2.0


@pytest.mark.parametrize(
    "form",
    [
        differs("net", "0 deg after 80 s"),
        differs("torque", "8.7 deg after 80 s, at most 8.8"),
        differs("gross", "8.6 deg after 80 s, at most 8.6"),
        "abrupt",
    ],
)
def test_the_inclination_of_12_degrees_is_reached(traces, form):
    assert inclination(traces[form])[-1] >= TWELVE - 0.5


@pytest.mark.parametrize("form", [differs("net", "no rise at all"), "torque", "gross", "abrupt"])
def test_the_elevation_keeps_rising_after_the_slip_has_grown(traces, form):
    """In the last 10 s, S is above 0.9 and the elevation rises by more than 1 mm."""
    trace = traces[form]
    late = trace.t > trace.t[-1] - 10.0
    assert np.min(trace["slip_ml"][late]) > 0.9
    assert trace["body_z"][-1] - trace["body_z"][late][0] > 1e-3


@pytest.mark.parametrize(("form", "slip", "degrees"), [("torque", 0.5, 4.6), ("torque", 0.9, 8.0), ("gross", 0.5, 4.5)])
def test_where_the_slip_grows_as_measured(traces, form, slip, degrees):
    assert degrees_at(traces[form], slip) == pytest.approx(degrees, abs=0.15)


def test_climb_ends_below_the_steepest_slope_the_factor_allows(traces):
    """atan(F(1) - R) = 8.8 deg with the torque form: the motion resistance holds a rover whose wheels spin."""
    assert 8.5 < inclination(traces["torque"])[-1] < 8.8
