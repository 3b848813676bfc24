"""Inputs of a replay: rows of equal distance, commands, positions and rates are computed from the rows of a log."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from rover_pin import Trace, scenario
from rover_pin.base.errors import DataError
from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import MotorEffect
from rover_pin.simulation.replay import Perturbation, ReplayCommands, commands, replay
from rover_pin.simulation.start import Start, shared_rest

NAN = math.nan


def log(period=0.05, count=40, attrs=None, **channels):
    """Return a log of a drive along x at 0.1 m/s from 2 s on. Its only wheel has duties that grow from row to row."""
    t = 2.0 + period * np.arange(count)
    default = {"t_s": t, "body_x": 0.1 * (t - 2.0), "body_y": np.full(count, 0.5), "body_yaw": np.full(count, 0.3)}
    return Trace({**default, "duty_a": np.arange(count) / 100.0, **channels}, attrs=attrs or {})


def test_fast_rows_are_averaged_to_50_ms_with_their_last_command():
    """Of the rows at 0, 10, ... ms, the rows from 30 to 70 ms belong to the replay's row at 50 ms. The command is the
    latest one until 30 ms.
    """
    run = commands(log(period=0.01, count=101), ("a",), ())
    assert run.t == pytest.approx(2.0 + 0.05 * np.arange(21))
    assert run.place[1:-1, 0] == pytest.approx(0.005 * np.arange(1, 20))
    assert run.duty[:3, 0] == pytest.approx([0.0, 0.03, 0.08])


def test_the_duty_between_uneven_rows_is_their_mean():
    """Commands come every 50 ms, and rows near these times: each row contains the command that acts when the row is
    read, early or late.
    """
    duty_given = 0.4 + 0.3 * np.sin(np.arange(401) / 40.0)  # of each 50 ms, up to its row
    t = np.random.default_rng(1).uniform(-0.015, 0.015, 400) + 0.05 * np.arange(400)
    read = duty_given[np.ceil(t / 0.05 - 1e-9).astype(int).clip(0)]
    run = commands(Trace({"t_s": t, "body_x": 0.1 * t, "body_y": 0 * t, "body_yaw": 0 * t, "duty_a": read}), ("a",), ())
    true = np.interp(run.t - 0.025, 0.05 * np.arange(401) - 0.025, duty_given)  # of the 50 ms before each row
    missed, rise = run.duty[2:-1, 0] - true[2:-1], np.gradient(true)[2:-1]
    lead = float(missed @ rise / (rise @ rise)) * 0.05
    assert abs(lead) < 0.006, "seconds by which the commands are early"
    even = commands(log(duty_a=duty_given[:40]), ("a",), ())
    assert even.duty[:, 0] == pytest.approx(duty_given[:40])


def test_uneven_rows_are_read_at_the_times_of_the_replay():
    """The replay's rows are counted from a first row that is late. This does not delay all other rows."""
    t = np.random.default_rng(2).uniform(-0.012, 0.012, 200) + 0.05 * np.arange(200)
    t[0] = 0.018
    x = 0.1 * np.sin(t)
    run = commands(Trace({"t_s": t, "body_x": x, "body_y": 0 * t, "body_yaw": 0 * t, "duty_a": 0 * t}), ("a",), ())
    assert run.place[1:-1, 0] == pytest.approx(0.1 * np.sin(run.t[1:-1]), abs=2e-4)


def test_across_missing_rows_the_duty_is_the_mean_of_both():
    duty = np.where(np.arange(40) < 20, 0.2, 0.6)
    log_without_gap = log(duty_a=duty)
    rows = (np.arange(40) < 15) | (np.arange(40) > 24)
    run = commands(Trace({name: log_without_gap[name][rows] for name in log_without_gap.channels}), ("a",), ())
    assert run.duty[:, 0] == pytest.approx(np.where((np.arange(40) < 15) | (np.arange(40) > 25), duty, 0.4))


def test_command_gaps_hold_the_last_and_heading_is_unwrapped():
    yaw = np.where(np.arange(40) < 20, 3.1, -3.1)
    yaw[25] = NAN
    duty = np.full(40, 0.2)
    duty[[0, 1, 7, 8]] = NAN, NAN, NAN, NAN
    duty[6] = 0.4
    run = commands(log(duty_a=duty, body_yaw=yaw, steer_a=np.linspace(0.0, 0.39, 40)), ("a",), ("a", "b"))
    assert run.duty[:10, 0] == pytest.approx([0.2] * 6 + [0.4] * 3 + [0.2])
    assert np.flatnonzero(np.isnan(run.place[:, 2])).tolist() == [25]
    assert np.delete(run.place[:, 2], 25)[20:] == pytest.approx(2 * math.pi - 3.1)
    assert run.steer[:, 0] == pytest.approx(np.linspace(0.0, 0.39, 40))
    assert not run.steer[:, 1].any(), "a wheel without a channel is not steered"


def test_a_log_without_duties_is_held_to_its_rates():
    rate = np.linspace(-1.0, 3.0, 40)
    rate[10] = NAN
    rate_log = log(wheel_rate_a=rate, wheel_rate_b=0.5 * rate)
    bare = Trace({name: values for name, values in rate_log.channels.items() if name != "duty_a"})
    run = commands(bare, ("a", "b"), ())
    assert run.rate_driven
    assert run.rate[:, 0] == pytest.approx(np.linspace(-1.0, 3.0, 40)), "a gap is bridged by a straight line"
    assert run.duty == pytest.approx(run.rate / 3.0), "as a share of the fastest"


def test_a_declared_start_is_taken_and_an_unknown_one_is_refused():
    attributes = {"start": {"x": 1.0, "y": 2.0, "yaw": 0.1}}
    assert commands(log(attrs=attributes), ("a",), ()).start == Start(1.0, 2.0, 0.1)
    x = np.linspace(0.0, 1.0, 40)
    x[:4] = NAN
    late = commands(log(body_x=x), ("a",), ())
    assert late.start.x == pytest.approx(x[4]), "of five rows one is known"
    x[4] = NAN
    with pytest.raises(DataError, match=r"0\.25.*declares"):
        commands(log(body_x=x), ("a",), ())
    assert commands(log(body_x=x, attrs=attributes), ("a",), ()).start.x == 1.0


def test_a_replay_whose_numbers_are_lost_has_diverged():
    drive = scenario("flat", duration=0.5)
    wheels = tuple(wheel.name for wheel in drive.model.rover.wheels)
    steered = tuple(wheel.name for wheel in drive.model.rover.wheels if wheel.steer_dof is not None)
    run, rest_state = commands(drive.drive(), wheels, steered), shared_rest(drive.model, Start())
    rest_state.shear[0] = NAN
    assert replay(drive.model, run, rest_state=rest_state).stop == "diverged"


@dataclass(frozen=True)
class Lurch(MotorEffect):
    """A motor effect with torque = tau tanh(omega / omega_0). At rest it accelerates a wheel with the growth rate tau /
    omega_0 / I = 3,200 1/s.
    """

    title: ClassVar[str] = "lurch"
    meaning: ClassVar[str] = "drives a wheel on"
    tau: Scalar = quantity(0.4, "N m", "made up", 0.0, 1.0, "tau")
    neutral: ClassVar[dict[str, float]] = {"tau": 0.0}

    def torque(self, drive, torque, x):
        return self.tau * ca.tanh(drive.omega / 0.1)


def test_a_replay_follows_a_growth_within_a_row():
    """With steps of 17 ms, every third of which ends at a row, the wheels would pass through rest with errors of up to
    1.4 rad/s.
    """
    model = scenario("flat").model
    duty = np.concatenate([np.full(60, 0.4), np.full(40, -0.3), np.linspace(-0.3, 0.3, 60)])
    rows = 0.05 * np.arange(len(duty))
    nowhere = np.full((len(duty), 3), NAN)
    run = ReplayCommands(rows, np.tile(duty[:, None], 6), np.zeros((len(duty), 4)), nowhere, Start())
    rest_state, lurching = shared_rest(model, Start()), model.having(Lurch())
    default, fine = (replay(lurching, run, rest_state=rest_state, fine=fine) for fine in (False, True))
    assert (default.stop, fine.stop) == ("", "")
    assert len(default.steps.lengths) < 0.6 * len(fine.steps.lengths)
    for name in ("wheel_rate_fl", "wheel_rate_rr"):
        assert default.channels[name] == pytest.approx(fine.channels[name], abs=0.1)


def test_rows_from_the_first_that_is_too_fast_on_are_lost():
    """The speed is checked at every tenth row. Under a force of 1 kN it exceeds 10 m/s between two checks."""
    model = scenario("flat").model
    rows, force = 0.05 * np.arange(40), np.where(np.arange(40) > 13, 1e3, 0.0)
    run = ReplayCommands(rows, np.full((40, 6), 0.4), np.zeros((40, 4)), np.full((40, 3), NAN), Start())
    lost = replay(model, run, Perturbation(force=force), rest_state=shared_rest(model, Start()))
    speed = lost.channels["body_vx"]
    assert "diverged" in lost.stop
    assert 1.0 < speed.max() < 10.0
    assert (speed[15:] == speed[-1]).sum() > 20


def test_commands_of_other_wheels_than_the_rovers_are_refused():
    """The compiled loop reads as many numbers in each row as the rover has wheels. With fewer numbers, it would read
    memory that belongs to other data.
    """
    drive = scenario("flat", duration=0.2)
    model, wheels = drive.model, tuple(wheel.name for wheel in drive.model.rover.wheels)
    for driven, steered, message in (
        (wheels, (), "6 driven and 0 steered"),
        (wheels[:4], wheels[:4], "4 driven and 4 steered"),
    ):
        with pytest.raises(DataError, match=rf"{message}.* 6 and 4"):
            replay(model, commands(drive.drive(), driven, steered))
