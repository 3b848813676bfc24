"""The linear model at a trim point, against the drive itself."""

import sys

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lsim

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.base.errors import MissingExtraError, SimulationError
from rover_pin.control.design.linear import linear_model, trim_state
from rover_pin.plot.response import response_figure

DUTY, MORE = 0.5, 0.01


@pytest.fixture(scope="module")
def flat():
    model = scenario("flat", soil="table-1").model
    state = trim_state(model, DUTY)
    return model, state, linear_model(model, state, DUTY)


def test_its_sizes_and_names_fit(flat):
    model, state, linear = flat
    states, wheels = len(linear.states), len(model.rover.wheels)
    assert linear.A.shape == (states, states)
    assert linear.B.shape == (states, wheels) == (states, len(linear.inputs))
    assert linear.C.shape == (len(linear.outputs), states)
    assert linear.D.shape == (len(linear.outputs), wheels)
    assert states == 2 * model.rover.model.nv + state.contact.size + state.motor.size
    displacement, speed = linear.states.index("body_x"), linear.states.index("body_vx")
    assert linear.A[displacement, speed] == pytest.approx(1.0, abs=1e-3)
    assert linear.C[0, speed] == pytest.approx(1.0)
    # The rate of a wheel is an output, so that its row of C shows which state has the wheel's name.
    for name in (wheel.name for wheel in model.rover.wheels):
        row = linear.C[linear.outputs.index(f"rate_{name}")]
        assert row[linear.states.index(f"wheel_rate_{name}")] == pytest.approx(1.0)
        # The step damps a wheel's rate within the step itself, so that the slope of its angle is slightly below 1.
        angle = linear.A[linear.states.index(f"wheel_angle_{name}")]
        assert angle[linear.states.index(f"wheel_rate_{name}")] == pytest.approx(1.0, abs=1e-2)
    assert len(set(linear.states)) == states
    assert linear.D[linear.outputs.index("current_fl"), 0] > 0.0


def test_a_small_step_of_duty_does_what_the_drive_does(flat):
    model, state, linear = flat
    wheels, n = len(model.rover.wheels), len(linear.A)
    both = np.zeros((n + 1, n + 1))
    both[:n, :n], both[:n, n] = linear.A, linear.B @ np.full(wheels, MORE)
    step, x, speeds = expm(0.05 * both), np.append(np.zeros(n), 1.0), []
    for _ in range(60):
        x = step @ x
        speeds.append(float(linear.C[0] @ x[:n]))
    before, after = (
        simulate(model, ConstantDuty(duty), 3.0, state.copy(), measure_error=False)["body_vx"]
        for duty in (DUTY, DUTY + MORE)
    )
    change = after - before
    assert change[-1] > 0.01 * before[-1]
    assert speeds == pytest.approx(change, abs=0.03 * change[-1])


def test_its_gain_at_rest_is_that_of_two_trim_points(flat):
    model, state, linear = flat
    more = trim_state(model, DUTY + MORE)
    gain = linear.response(1e-3)[0].sum()
    assert gain.real == pytest.approx((more.v[0] - state.v[0]) / MORE, rel=0.03)
    assert abs(linear.response(1e3)[0].sum()) < 1e-2 * abs(gain)


def test_a_rover_that_still_speeds_up_is_refused():
    with pytest.raises(SimulationError, match="no trim point"):
        trim_state(scenario("flat").model, DUTY, 0.1)


def test_its_step_response_is_that_of_another_integrator(flat):
    linear, t = flat[2], np.linspace(0.0, 1.0, 201)
    _, rows, _ = lsim((linear.A, linear.B, linear.C, linear.D), np.ones((len(t), linear.B.shape[1])), t)
    np.testing.assert_allclose(linear.step_response(t), rows, rtol=1e-6, atol=1e-9)
    speed = linear.outputs.index("speed")
    assert linear.step_response(np.linspace(0.0, 10.0, 101))[-1, speed] == pytest.approx(
        linear.response(1e-4)[speed].sum().real, rel=1e-3
    )
    figure = response_figure(linear, outputs=("speed", "slip_fl"))
    assert [len(axes.lines) for axes in figure.axes] == [2, 2, 2]


def test_python_control_gets_the_same_system(flat):
    control = pytest.importorskip("control")
    linear = flat[2]
    system = linear.to_ss()
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(system, name), getattr(linear, name))
    assert (system.state_labels, system.input_labels, system.output_labels) == (
        list(linear.states), list(linear.inputs), list(linear.outputs)
    )  # fmt: skip
    # A subsystem is chosen by names, and its response is that of the package.
    omega = 2.0 * np.pi
    response = control.frequency_response(system["speed", "duty_fl"], [omega]).complex.item()
    assert response == pytest.approx(linear.response(omega)[0, linear.inputs.index("duty_fl")], rel=1e-9)


def test_without_python_control_the_message_says_what_to_install(flat, monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingExtraError, match=r"pip install .control"):
        flat[2].to_ss()
