"""The compiled loop is compared with the plain loop, which shares only the step with it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import ConstantDuty, Trace, scenario, simulate
from rover_pin.simulation import replay as replays
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import RunningDrive, run_compiled
from rover_pin.simulation.failure import failure
from rover_pin.simulation.native.control import CompiledController, commands_of
from rover_pin.simulation.native.loop import Loop, LoopStatus
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.plain.run import record_of_instant, run_plain
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.start import Start, settled_state, shared_rest, taken_over
from rover_pin.simulation.state import Checkpoint, base_rotation, roll_pitch_yaw
from rover_pin.simulation.stepping.pace import FINEST, Pace
from rover_pin.simulation.stepping.timing import DT, Timing
from rover_pin.simulation.trace.record import row_type
from tests.simulation import random_drives

MOTORS = [RECORD.index(name) for name in ("torque", "current", "supply")]
STIFF = {"soil.k": 0.0004, "soil.n": 0.6}
CASES = {
    "ditch under slip control": (scenario("ditch", soil="table-1", duration=4.0), Timing()),
    "control and rows of other periods": (scenario("bump", soil="table-1", duration=2.0), Timing(0.005, 0.1, 0.02)),
    "steps in parts": (scenario("ditch", soil="table-1", duration=2.0, **STIFF), Timing(0.02, 0.1, 0.1)),
    "steered, on a grid": (scenario("hills", soil="table-1", duration=2.0), Timing()),
    "buried": (scenario("ditch", soil="table-1", duration=9.0, buried=0.21), Timing()),
}


SWEPT = 66
"""Seed of the random drives whose forces turn so fast that a step of two of the finest parts is taken again."""


def swept():
    chosen = random_drives.drive(SWEPT)
    return SimpleNamespace(model=chosen.model, controller=chosen.controller, start=chosen.start, duration=0.1), Timing()


def both(case, timing):
    """Return the traces of one drive by the compiled loop and by the plain loop, both with the compiled step."""
    traces = []
    for run in (run_compiled, run_plain):
        state = settled_state(case.model, case.start)
        begun = case.model.begin_at(float(state.q[0]), float(state.q[1]))
        if hasattr(case.controller, "reset"):
            case.controller.reset()
        kernel, times = Kernel(begun, state, timing.dt, symmetric=False), []
        traces.append(
            (
                run(RunningDrive(begun, state, kernel, case.controller, timing), case.duration, times.append),
                times,
                state,
            )
        )
    return traces


@pytest.mark.parametrize("name", [*CASES, "parts of parts"])
def test_both_loops_drive_alike(name, monkeypatch):
    again, before = [], Pace._take_again
    monkeypatch.setattr(Pace, "_take_again", lambda pace, long: again.append(long.size) or before(pace, long))
    (ours, times, state), (theirs, plain_times, plain_state) = both(*(CASES[name] if name in CASES else swept()))
    assert name in CASES or {2, 4, 8, 16, 32, 64} == set(again)
    assert (ours.stop, times) == (theirs.stop, plain_times)
    assert ours.checkpoint == theirs.checkpoint
    assert len(ours.rows) == len(theirs.rows) > 0
    for column in ours.rows.dtype.names:
        assert ours.rows[column] == pytest.approx(theirs.rows[column], rel=1e-10, abs=1e-12), column
    assert state.q == pytest.approx(plain_state.q, rel=1e-12, abs=1e-12)
    assert state.t == plain_state.t


def plain_replay(model, run, nudge, rest_state, step=Kernel):
    """Replay a log row by row in Python, as the docstring of `replay` describes it, and return the rows."""
    state = taken_over(model, rest_state)
    model = model.begin_at(run.start.x, run.start.y)
    kernel = step(model, state, DT, symmetric=False)
    q_of = {joint.idx_v: joint.idx_q for joint in model.rover.model.joints}
    servos = [q_of[wheel.steer_dof] for wheel in model.rover.wheels if wheel.steer_dof is not None]
    gives, rates = np.zeros(len(servos)), np.zeros(len(model.rover.wheels))
    if run.rate_driven:
        kernel.hold(rates)
    pace, values = Pace(kernel, DT, replays.ROUGH), np.zeros(3)
    rows = np.zeros(len(run.t), dtype=row_type(model))
    if not run.rate_driven:
        down, soils = kernel.gravity.copy(), kernel.soils.copy()
    phi = list(model.soils[0].values()).index("phi")
    for row in range(len(run.t)):
        torque = 0.0 if nudge.torque is None else nudge.torque[row] / float(model.motor.stall_torque)
        kernel.duty[:] = np.clip(run.duty[row] + torque, -1.0, 1.0)
        before, gives = gives, kernel.servo_target[: len(servos)] - state.q[servos]
        kernel.servo_target[: len(servos)] = run.steer[row] + 2.0 * gives - before
        if nudge.force is not None:
            yaw = roll_pitch_yaw(state.q)[2]
            pull = nudge.force[row] / model.built.mass
            kernel.gravity[:] = down + pull * np.array([math.cos(yaw), math.sin(yaw), 0.0])
        if nudge.grip is not None:
            changed = soils.copy()
            changed[:, phi] = np.arctan((1.0 + nudge.grip[row]) * np.tan(soils[:, phi]))
            kernel.set_soils(changed)
        count = round(run.period / DT)
        for part in range(count):
            if run.rate_driven:
                before = run.rate[max(row - 1, 0)]
                rates[:] = before + (part + 1) / count * (run.rate[row] - before)
            assert pace.advance(part == 0) == 0
        assert failure(model, state, kernel.record) is None
        rows[row]["q"], rows[row]["v"], rows[row]["moved"] = state.q, state.v, values
        rows[row]["record"] = kernel.record
        if not run.rate_driven:
            rows[row]["record"][:, MOTORS] = record_of_instant(kernel)[0][:, MOTORS]
        rows[row]["attitude"] = roll_pitch_yaw(state.q)
        rows[row]["velocity"] = base_rotation(state.q) @ state.v[:3]
        draw(state.q, run.place[row], run.period / replays.HOLD, values)
    return rows


def draw(q, place, share, shift):
    if np.all(np.isfinite(place[:2])):
        step = share * (place[:2] - q[:2])
        q[:2] += step
        shift[:2] += step
    if math.isfinite(place[2]):
        turn = share * math.remainder(place[2] - roll_pitch_yaw(q)[2], 2 * math.pi)
        c, s = math.cos(turn / 2), math.sin(turn / 2)
        x, y, z, w = q[3:7]
        q[3:7] = c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z
        shift[2] += turn


def logged(name, duration=3.0):
    case = scenario(name, soil="table-1", duration=duration)
    steered = tuple(wheel.name for wheel in case.model.rover.wheels if wheel.steer_dof is not None)
    return case, replays.commands(case.drive(), tuple(wheel.name for wheel in case.model.rover.wheels), steered)


@pytest.mark.parametrize("kind", ["plain", "with gaps", "nudged"])
def test_a_replay_is_the_plain_one(kind):
    case, run = logged("ditch")
    n, nudge = len(run.t), replays.Perturbation()
    run.place[:, 0] += 0.01
    if kind == "with gaps":
        run.place[10:20, :2] = np.nan
        run.place[15:30, 2] = np.nan
    if kind == "nudged":
        wave = np.sin(np.arange(n))
        nudge = replays.Perturbation(0.02 * np.outer(wave, np.ones(6)), 2.0 * wave, 0.1 * wave)
    rest_state = shared_rest(case.model, run.start)
    ours = replays.replay(case.model, run, nudge, rest_state)
    theirs = replays._channels(case.model, run, plain_replay(case.model, run, nudge, rest_state))
    assert ours.stop == ""
    for channel, values in theirs.items():
        assert ours.channels[channel] == pytest.approx(values, rel=1e-9, abs=1e-11), channel


def held(run, trace, model):
    """Return the run with the wheels held to the rates in the trace."""
    bare = Trace({name: trace[name] for name in trace if not name.startswith("duty_")}, {}, dict(trace.attrs))
    steered = tuple(wheel.name for wheel in model.rover.wheels if wheel.steer_dof is not None)
    return replays.commands(bare, tuple(wheel.name for wheel in model.rover.wheels), steered)


@pytest.mark.parametrize("step", [Kernel, PlainStepper])
def test_a_replay_held_to_wheel_rates_is_the_plain_one(step):
    case, run = logged("ditch", 1.5)
    run = held(run, case.drive(), case.model)
    run.rate[:, 0] *= 1.03
    run.place[:, 0] += 0.01
    rest_state = shared_rest(case.model, run.start)
    ours = replays.replay(case.model, run, rest_state=rest_state)
    theirs = replays._channels(case.model, run, plain_replay(case.model, run, replays.Perturbation(), rest_state, step))
    assert ours.stop == ""
    for channel, values in theirs.items():
        assert ours.channels[channel] == pytest.approx(values, rel=2e-6, abs=1e-7), channel


def test_held_rates_reproduce_the_drive_made_by_the_motors():
    case, run = logged("ditch", 6.0)
    trace = case.drive()
    by_duty = replays.replay(case.model, run).channels
    by_rate = replays.replay(case.model, held(run, trace, case.model)).channels
    for wheel in trace.wheels:
        measured = np.interp(run.t, trace.t, trace[f"wheel_rate_{wheel}"])
        assert by_rate[f"wheel_rate_{wheel}"] == pytest.approx(measured, abs=1e-6)
        # the current of the torque that holds the wheel is that with which the motor turned it
        drawn = by_duty[f"current_{wheel}_A"]
        assert by_rate[f"current_{wheel}_A"] == pytest.approx(drawn, abs=0.05 * np.ptp(drawn))
    assert by_rate["body_x"] == pytest.approx(trace["body_x"][: len(run.t)], abs=3e-4)
    assert by_rate["body_pitch"] == pytest.approx(by_duty["body_pitch"], abs=1e-4)


def test_torques_that_hold_the_wheels_enter_the_energy_balance():
    """The change of kinetic and potential energy equals the work of the torques that hold the wheels, minus the energy
    that the soil takes.
    """
    case, run = logged("ditch", 4.0)
    run = held(run, case.drive(), case.model)
    state = settled_state(case.model, run.start)
    kernel, rates = Kernel(case.model, state, 0.002, symmetric=False), np.zeros(6)
    kernel.hold(rates)
    start = sum(kernel.energies())
    for k in range(2000):
        at = min((k + 1) * 0.002 / run.period, len(run.t) - 1)
        rates[:] = [np.interp(at, np.arange(len(run.t)), column) for column in run.rate.T]
        assert kernel.step() == 0
    motor, *losses = kernel.energy[[0, 1, 2, 3, 5]]
    assert sum(kernel.energies()) - start == pytest.approx(motor - sum(losses), abs=0.01 * abs(motor))


def test_last_good_row_fills_the_rest_after_an_early_end():
    case, run = logged("ditch", 9.0)
    buried = scenario("ditch", soil="table-1", buried=0.21).model
    replay = replays.replay(buried, run, rest_state=shared_rest(case.model, run.start))
    assert replay.stop.startswith("buried: ")
    whole_replay = replays.replay(case.model, run, rest_state=shared_rest(case.model, run.start))
    x = replay.channels["body_x"]
    last = int(np.flatnonzero(np.diff(x))[-1]) + 1
    assert 0 < last < len(x) - 1
    assert np.array_equal(x[: last + 1], whole_replay.channels["body_x"][: last + 1])
    assert np.all(x[last:] == x[last])
    sunk = np.max([whole_replay.channels[f"sinkage_{wheel.name}"] for wheel in buried.rover.wheels], axis=0)
    looked = np.flatnonzero(sunk > 0.21 * 0.045)
    assert last == looked[looked % 10 == 0][0] - 1, "of every tenth row, which are looked at, it failed the next"


MODEL = scenario("flat").model


def loop_of(steps=6, per_sample=2, **more):
    return Loop(Kernel(MODEL, settled_state(MODEL, Start()), 0.005, symmetric=False), 0.005, steps, per_sample, **more)


@pytest.mark.parametrize("steps", [0, 1, 2, 3])
def test_a_continued_drive_calls_the_controller_where_it_ended(steps):
    loop = loop_of(per_sample=1, per_control=1)
    loop.ask()
    loop.continue_from(Checkpoint(1.0, steps, FINEST))
    assert loop.run(6) is LoopStatus.ASKS
    assert (loop.checkpoint.steps, loop.state.t) == (steps, pytest.approx(1.0 + 0.005 * steps))


class Fixed:
    """A built-in controller that returns commands for a given number of wheels and servos."""

    def __init__(self, duty, steer):
        self.commands = CompiledController(duty=duty, steer=steer)

    def __call__(self, reading):
        raise NotImplementedError

    def native(self, wheels):
        return self.commands


@pytest.mark.parametrize(
    ("duty", "steer", "servos", "fits"),
    [
        (0.5, 0.1, 4, True),
        (np.zeros(6), np.zeros(4), 4, True),
        (np.zeros(5), 0.1, 4, False),
        (0.5, np.zeros(3), 4, False),
        (0.5, np.zeros(3), None, True),
        (0.5, 0.0, 0, True),
        (0.5, np.zeros(3), 0, True),
    ],
)
def test_commands_of_another_rover_are_refused(duty, steer, servos, fits):
    """Commands for another number of wheels are refused by Python. If nothing steers, angles are not read."""
    controller = Fixed(duty, steer)
    assert commands_of(controller, 6, servos) is (controller.commands if fits else None)


def test_a_compiled_drive_reports_progress_every_fifty_rows():
    progress = []
    simulate(MODEL, ConstantDuty(0.3), 0.6, timing=Timing(0.005, 0.005, 0.005), progress=progress.append)
    assert progress == pytest.approx([0.25, 0.5])
