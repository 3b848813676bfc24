"""The compiled loop against the plain one, which shares with it nothing but the step."""

import math

import numpy as np
import pytest

from rover_pin.motion import replay as replays
from rover_pin.motion.compiled_run import run_compiled
from rover_pin.motion.driving import Drive
from rover_pin.motion.failure import failure, suspension_of
from rover_pin.motion.kernel import Kernel
from rover_pin.motion.pace import FINEST, Pace
from rover_pin.motion.place import settled
from rover_pin.motion.plain_run import run_plain
from rover_pin.motion.rows import row_type
from rover_pin.motion.state import base_rotation, roll_pitch_yaw
from rover_pin.motion.timing import Timing
from rover_pin.scenarios import scenario

STIFF = {"soil.k": 0.0004, "soil.n": 0.6}
CASES = {
    "ditch under slip control": (scenario("ditch", duration=4.0), Timing()),
    "control and rows of other periods": (scenario("bump", duration=2.0), Timing(0.005, 0.1, 0.02)),
    "steps in parts": (scenario("ditch", duration=2.0, **STIFF), Timing(0.02, 0.1, 0.1)),
    "steered, on a grid": (scenario("hills", duration=2.0), Timing()),
    "buried": (scenario("ditch", duration=9.0, buried=0.21), Timing()),
}


def both(case, timing):
    """The same drive by the compiled loop and by the plain one, both over the compiled step."""
    ran = []
    for run in (run_compiled, run_plain):
        state = settled(case.model, case.start)
        begun = case.model.begun(float(state.q[0]), float(state.q[1]))
        if hasattr(case.controller, "reset"):
            case.controller.reset()
        kernel, times = Kernel(begun, state, timing.dt, symmetric=False), []
        ran.append(
            (run(Drive(begun, state, kernel, case.controller, timing), case.duration, times.append), times, state)
        )
    return ran


@pytest.mark.parametrize("name", CASES)
def test_both_loops_drive_alike(name):
    (ours, times, state), (theirs, plain_times, plain_state) = both(*CASES[name])
    assert (ours.stop, times) == (theirs.stop, plain_times)
    assert ours.counted.missed == pytest.approx(theirs.counted.missed, rel=1e-9)
    assert len(ours.rows) == len(theirs.rows) > 0
    for column in ours.rows.dtype.names:
        assert ours.rows[column] == pytest.approx(theirs.rows[column], rel=1e-10, abs=1e-12), column
    assert state.q == pytest.approx(plain_state.q, rel=1e-12, abs=1e-12)
    assert state.t == plain_state.t


def test_the_cases_meet_what_they_are_for():
    (stiff, *_), _ = both(*CASES["steps in parts"])
    assert stiff.counted.missed > 0.0
    (buried, *_), _ = both(*CASES["buried"])
    assert buried.stop.startswith("buried: wheel ")


def plain_replay(model, run, nudge, rest):
    """A replay row after row in Python, as `replay` says it is done; return the rows."""
    state = replays._taken_over(model, rest)
    model = model.begun(run.start.x, run.start.y)
    kernel = Kernel(model, state, replays.DT, symmetric=False)
    pace, suspension, moved = Pace(kernel, replays.DT), suspension_of(model), np.zeros(3)
    down, soils, rows = kernel.gravity.copy(), kernel.soils.copy(), np.zeros(len(run.t), dtype=row_type(model))
    phi = list(model.soils[0].values()).index("phi")
    for row in range(len(run.t)):
        torque = 0.0 if nudge.torque is None else nudge.torque[row] / float(model.motor.stall_torque)
        kernel.duty[:] = np.clip(run.duty[row] + torque, -1.0, 1.0)
        kernel.servo_target[: run.steer.shape[1]] = run.steer[row]
        if nudge.force is not None:
            yaw = roll_pitch_yaw(state.q)[2]
            pull = nudge.force[row] / model.built.mass
            kernel.gravity[:] = down + pull * np.array([math.cos(yaw), math.sin(yaw), 0.0])
        if nudge.grip is not None:
            changed = soils.copy()
            changed[:, phi] = np.arctan((1.0 + nudge.grip[row]) * np.tan(soils[:, phi]))
            kernel.resoil(changed)
        for step in range(round(run.period / replays.DT)):
            assert pace.advance(step == 0) == 0
        assert failure(model, state, kernel.record, suspension) is None
        rows[row]["q"], rows[row]["v"], rows[row]["moved"] = state.q, state.v, moved
        rows[row]["record"], rows[row]["attitude"] = kernel.record, roll_pitch_yaw(state.q)
        rows[row]["velocity"] = base_rotation(state.q) @ state.v[:3]
        draw(state.q, run.place[row], run.period / replays.HOLD, moved)
    return rows


def draw(q, place, share, moved):
    if np.all(np.isfinite(place[:2])):
        step = share * (place[:2] - q[:2])
        q[:2] += step
        moved[:2] += step
    if math.isfinite(place[2]):
        turn = share * math.remainder(place[2] - roll_pitch_yaw(q)[2], 2 * math.pi)
        c, s = math.cos(turn / 2), math.sin(turn / 2)
        x, y, z, w = q[3:7]
        q[3:7] = c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z
        moved[2] += turn


def logged(name, duration=3.0):
    case = scenario(name, duration=duration)
    steered = tuple(wheel.name for wheel in case.model.rover.wheels if wheel.steer_dof is not None)
    return case, replays.commands(case.drive(), tuple(wheel.name for wheel in case.model.rover.wheels), steered)


@pytest.mark.parametrize("kind", ["plain", "with gaps", "nudged"])
def test_a_replay_is_the_plain_one(kind):
    case, run = logged("ditch")
    n, nudge = len(run.t), replays.Nudge()
    run.place[:, 0] += 0.01
    if kind == "with gaps":
        run.place[10:20, :2] = np.nan
        run.place[15:30, 2] = np.nan
    if kind == "nudged":
        wave = np.sin(np.arange(n))
        nudge = replays.Nudge(0.02 * np.outer(wave, np.ones(6)), 2.0 * wave, 0.1 * wave)
    rest = settled(case.model, run.start)
    ours = replays.replay(case.model, run, nudge, rest)
    theirs = replays._channels(case.model, run.t, plain_replay(case.model, run, nudge, rest))
    assert ours.stop == ""
    for channel, values in theirs.items():
        assert ours.channels[channel] == pytest.approx(values, rel=1e-9, abs=1e-11), channel


def test_after_an_early_end_the_last_good_row_stands_for_the_rest():
    case, run = logged("ditch", 9.0)
    buried = scenario("ditch", buried=0.21).model
    ended = replays.replay(buried, run, rest=settled(case.model, run.start))
    assert ended.stop.startswith("buried: ")
    whole = replays.replay(case.model, run, rest=settled(case.model, run.start))
    x = ended.channels["body_x"]
    last = int(np.flatnonzero(np.diff(x))[-1]) + 1
    assert 0 < last < len(x) - 1
    assert np.array_equal(x[: last + 1], whole.channels["body_x"][: last + 1])
    assert np.all(x[last:] == x[last])


def test_the_first_row_of_a_replay_that_fails_at_once_is_where_it_is():
    case, run = logged("ditch")
    rest = settled(case.model, run.start)
    rest.q[3:7] = 1.0, 0.0, 0.0, 0.0
    ended = replays.replay(case.model, run, rest=rest)
    assert ended.stop.startswith("capsized") or ended.stop == "diverged"
    assert np.all(ended.channels["body_roll"] == ended.channels["body_roll"][0])


def test_the_finest_part_of_a_step_is_a_power_of_two():
    """dt / FINEST times FINEST is dt to the bit, so that a drive in parts keeps its times."""
    assert math.log2(FINEST) == int(math.log2(FINEST))
