"""The compiled step is compared with the plain step, which shares neither geometry code nor linear algebra with it. The
plain step uses Pinocchio's mass matrix (CRBA) or its articulated bodies (ABA).
"""

import numpy as np
import pytest

from rover_pin.simulation.compiled.kernel import DIRECTION_SPEED, Kernel
from rover_pin.simulation.plain.articulated import articulated_stages
from rover_pin.simulation.plain.composite import composite_stages
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.start import settled_state
from tests.simulation import kernel_cases as cases

ROVER, CASES = cases.ROVER, cases.CASES


def assert_alike(plain, kernel):
    """Check that all arrays that a step changes, and all results that it reports, are equal in both."""
    second, state = plain.state, kernel.state
    assert second.q == pytest.approx(state.q, abs=1e-11)
    assert second.v == pytest.approx(state.v, abs=1e-9)
    assert second.contact == pytest.approx(state.contact, abs=1e-9)
    assert second.motor == pytest.approx(state.motor, abs=1e-9)
    assert plain.record == pytest.approx(kernel.record, rel=1e-8, abs=1e-8)
    assert plain.loads == pytest.approx(kernel.loads, rel=1e-8, abs=1e-8)
    assert plain.mean_loads == pytest.approx(kernel.mean_loads, rel=1e-8, abs=1e-8)
    assert plain.energy == pytest.approx(kernel.energy, rel=1e-9, abs=1e-10)
    assert plain.impulse == pytest.approx(kernel.impulse, rel=1e-9, abs=1e-10)
    assert plain.misjudged == pytest.approx(kernel.misjudged, rel=1e-6, abs=1e-9)
    assert plain.growth == pytest.approx(kernel.growth, rel=1e-6, abs=1e-6)
    assert plain.foreseen == pytest.approx(kernel.foreseen, rel=1e-8, abs=1e-8)
    assert plain.differential == pytest.approx(kernel.differential, rel=1e-8, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_steps_agree(name):
    """The steps are compared state by state, so that a chaotic motion can neither hide an error nor cause one."""
    model, start = CASES[name]
    state = settled_state(model, start)
    if name == "past its stops":
        cases.bent(state)
    kernel = Kernel(model, state, 0.005, symmetric=False)
    plain_state = state.copy()
    plain = PlainStepper(model, plain_state, 0.005, symmetric=False)
    duty, steer = cases.DUTY.get(name, 1.0) * np.linspace(0.4, 0.9, 6), np.array([0.1, 0.12, -0.1, -0.12])
    for k in range(1200):
        if k == 900:
            duty = -duty
        kernel.duty[:], kernel.servo_target[:] = duty, steer
        if k % 40 == 0:
            for mine, theirs in (
                (plain_state.q, state.q),
                (plain_state.v, state.v),
                (plain_state.contact, state.contact),
                (plain_state.motor, state.motor),
            ):
                mine[:] = theirs
            plain.duty[:], plain.servo_target[:] = duty, steer
            plain.energy[:], plain.impulse[:], plain.foreseen[:] = kernel.energy, kernel.impulse, kernel.foreseen
            plain.record[:] = kernel.record
            assert (plain.step(), kernel.step()) == (0, 0)
            assert_alike(plain, kernel)
        else:
            assert kernel.step() == 0
    assert kernel.pivoted == 0, "rows were exchanged, which hides what the elimination does"


@pytest.mark.parametrize("name", CASES)
def test_a_step_agrees_where_everything_moves(name):
    """The state does not occur in a drive, so that no term of the equations is 0."""
    model, start = CASES[name]
    assert assert_a_step_alike(model, cases.stirred(model, settled_state(model, start)), symmetric=False) > 0.0


def test_a_step_agrees_that_is_made_symmetric():
    model, start = CASES["hills"]
    state = cases.stirred(model, settled_state(model, start))
    assert_a_step_alike(model, state, symmetric=True)
    perm, sign = ROVER.mirror
    assert np.array_equal(state.v, sign * state.v[perm])


def assert_a_step_alike(model, state, symmetric):
    """Check two steps against both plain steppers, and return the forecast error that the second compiled
    step found.
    """
    others = [
        PlainStepper(model, state.copy(), 0.005, symmetric, stages) for stages in (composite_stages, articulated_stages)
    ]
    kernel = Kernel(model, state, 0.005, symmetric)
    for stepper in (*others, kernel):
        stepper.duty[:] = np.linspace(-0.3, 0.9, 6)
        stepper.servo_target[:] = [0.1, 0.12, -0.1, -0.12]
    for _ in range(2):  # the second knows what the first took the loads to become
        assert kernel.step() == 0
        for plain in others:
            assert plain.step() == 0
            assert_alike(plain, kernel)
    return kernel.misjudged


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_step_agrees_past_the_stops(way):
    """Every joint is bent beyond an end stop and moves further or back, so that the stops push and take energy."""
    model, start = CASES["past its stops"]
    state = cases.stirred(model, settled_state(model, start))
    cases.bent(state)
    for joint in ("bogie_l", "bogie_r", "rocker_l", "rocker_r"):
        state.q[ROVER.angles[joint]] *= way
    assert_a_step_alike(model, state, symmetric=False)


@pytest.mark.parametrize("share", [1e-3, 1e3])
def test_forecast_errors_are_equal(share):
    """The predicted load of one wheel at a time is changed, for wheels that carry more or less than their share."""
    model, start = CASES["two-widths"]
    state, misjudged = settled_state(model, start), []
    plain, kernel = PlainStepper(model, state.copy(), 0.005, False), Kernel(model, state, 0.005, False)
    plain.wheel_share = kernel.struct.wheel_share = share
    for _ in range(2):
        assert (plain.step(), kernel.step()) == (0, 0)
    saved = plain.saved_arrays(), kernel.saved_arrays()
    for wheel in range(6):
        for load in range(4):
            for stepper, before in zip((plain, kernel), saved, strict=True):
                stepper.restore(before)
                stepper.foreseen[wheel, load] += -2.0 if load == 2 and wheel % 2 else 0.01 * wheel + 0.1
                assert stepper.step() == 0
            misjudged.append(kernel.misjudged)
            assert plain.misjudged == pytest.approx(kernel.misjudged, rel=1e-6)
    assert len({round(value, 9) for value in misjudged}) > 8, "left and right are alike, and no more"


def through_rest(state, share):
    """Let the rover creep and its wheels turn partly backwards, with speeds of a fraction `share` of
    DIRECTION_SPEED.
    """
    state.v[:] = 0.0
    state.v[0] = share * DIRECTION_SPEED
    for at, wheel in enumerate(ROVER.wheels):
        state.v[wheel.dof] = (1.0 - 0.35 * at) * share * DIRECTION_SPEED / float(wheel.wheel.r)


@pytest.mark.parametrize("name", ["held", "eq-1"])
def test_steps_agree_through_rest(name):
    """Around rest the law is a blend of both directions, whose weights change completely within a step or two."""
    model, start = CASES[name]
    rest_state = settled_state(model, start)
    for share in np.linspace(-1.5, 1.5, 31):
        states = [rest_state.copy(), rest_state.copy()]
        for state in states:
            through_rest(state, share)
        kernel, plain = (
            kind(model, state, 0.005, False) for kind, state in zip((Kernel, PlainStepper), states, strict=True)
        )
        assert (kernel.step(), plain.step()) == (0, 0)
        assert states[1].v == pytest.approx(states[0].v, abs=1e-11)
        assert plain.loads == pytest.approx(kernel.loads, rel=1e-8, abs=1e-9)
        assert plain.foreseen == pytest.approx(kernel.foreseen, rel=1e-8, abs=1e-9)


def test_a_dropped_rover_is_the_same_in_both():
    """First all wheels are in the air, then they touch the ground."""
    model, start = CASES["ditch"]
    state = settled_state(model, start)
    state.q[2] += 0.01
    duplicate = state.copy()
    kernel, plain = Kernel(model, state, 0.005, False), PlainStepper(model, duplicate, 0.005, False)
    for _ in range(40):
        assert (kernel.step(), plain.step()) == (0, 0)
    assert duplicate.q == pytest.approx(state.q, abs=1e-9)
    assert kernel.record[:, 2].min() > 0.0
