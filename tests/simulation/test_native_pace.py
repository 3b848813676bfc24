"""The step-size control in C is compared with the one in Python. Both advance steps that only follow a script."""

import ctypes

import numpy as np
import pytest

from rover_pin.simulation import native
from rover_pin.simulation.compiled import toolchain
from rover_pin.simulation.native.shared import DriveStruct, LoopStruct, fill
from rover_pin.simulation.stepping.pace import CALM, FINEST, GLANCE, GROWS, ROUGH, Pace

DT, SEEDS = 0.005, 40
SIZES = (2, 3)
SCRIPT = """
static double place[2048], *script = place, steps[1024];
static int calls;
int rover_pin_step(Drive *d) {
  steps[calls] = d->dt;
  d->q[0] += d->dt;
  d->q[1] += d->q[0] * (calls + 1);
  for (int i = 0; i < 3; ++i) d->v[i] = 0.5 * d->v[i] + d->q[i % 2];
  d->misjudged = script[3 * calls + 1];
  d->growth = script[3 * calls + 2];
  return (int)script[3 * calls++];
}
"""
PROBES = """
void probe_script(const double *from, integer n) { memcpy(script, from, n * sizeof(double)); calls = 0; }
int probe_told(double *to) { memcpy(to, steps, sizeof steps); return calls; }
int probe_advance(Drive *d, Loop *l, int commanded, int looks) { return advance(d, l, commanded, looks); }
"""
ROUGH_BY = 0.25
SHARES = [
    ROUGH_BY * share for share in (0.0, 0.9 * CALM, CALM, 1.1 * CALM, 0.5 * ROUGH, ROUGH, 1.01 * ROUGH, 4.0 * ROUGH)
]


@pytest.fixture(scope="module")
def compiled():
    """Return the compiled step-size control as a library that advances the steps of a script."""
    parts = [native.file_text(name) for name in ("lanes.h", "types.h", "shared.py", "structs.h")]
    source = "".join([*parts, SCRIPT, native.file_text("pace.c"), PROBES])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", ("-O0", *toolchain.FLAGS[1:]))
        return toolchain.shared_library(source, "pace")


class Scripted:
    """The steps of the script in Python."""

    def __init__(self, script):
        self.script, self.calls, self.misjudged, self.growth, self.dt, self.steps = script, 0, 0.0, 0.0, DT, []
        self.q, self.v = np.arange(2.0), np.arange(3.0)

    def set_step(self, dt):
        self.dt = dt

    def step(self):
        self.steps.append(self.dt)
        self.q[0] += self.dt
        self.q[1] += self.q[0] * (self.calls + 1)
        for i in range(3):
            self.v[i] = 0.5 * self.v[i] + self.q[i % 2]
        status, self.misjudged, self.growth = self.script[self.calls]
        self.calls += 1
        return int(status)

    def saved_arrays(self):
        return [self.q.copy(), self.v.copy()]

    def restore(self, saved):
        self.q[:], self.v[:] = saved


class Ours:
    """The C structs of the step-size control."""

    def __init__(self, library, script):
        self.library, self.keep = library, {}
        self.drive, self.loop = DriveStruct(), LoopStruct()
        self.q, self.v, self.saved = np.arange(2.0), np.arange(3.0), np.full(2 * sum(SIZES) + 2, 7.0)
        fill(self.drive, self.keep, {"q": self.q, "v": self.v, "dt": DT, "differential": np.zeros(1)})
        moving = np.array([array.ctypes.data for array in (self.q, self.v)], dtype=np.int64)
        values = {"moving": moving, "moving_sizes": np.array(SIZES, dtype=np.int64), "n_moving": 2}
        values |= {"moving_size": sum(SIZES), "saved": self.saved, "size": FINEST, "dt": DT, "rough": ROUGH_BY}
        fill(self.loop, self.keep, {**values, "now": np.zeros(1)})
        at = np.ascontiguousarray(script)
        library.probe_script(ctypes.c_void_p(at.ctypes.data), ctypes.c_int64(at.size))

    def advance(self, commanded, looks):
        return self.library.probe_advance(ctypes.byref(self.drive), ctypes.byref(self.loop), int(commanded), int(looks))

    def steps(self):
        steps = np.zeros(1024)
        return list(steps[: self.library.probe_told(ctypes.c_void_p(steps.ctypes.data))])


def drawn(seed):
    """Return a random script, and the steps at which a command is due; the step before each command is examined."""
    rng = np.random.default_rng(seed)
    odds = rng.dirichlet(np.full(len(SHARES), 0.4))
    fails, misjudged = rng.random(500) < rng.choice([0.0, 0.05]), rng.choice(SHARES, 500, p=odds)
    growth = np.where(rng.random(500) < rng.choice([0.0, 0.05]), 2.0 * GROWS, 0.0)
    script = np.column_stack([fails, misjudged, growth])
    script[:, 0] *= rng.integers(1, 3, 500)
    commanded = rng.random(31) < rng.choice([0.3, 0.9])
    return script, list(zip(commanded[:-1], commanded[1:], strict=True))


@pytest.mark.parametrize("seed", range(SEEDS))
def test_the_compiled_pace_takes_the_steps_of_the_plain_one(compiled, seed):
    """Steps fail, are mispredicted or grow, before and after commands. Both controls take equal steps from
    equal times.
    """
    script, commands = drawn(seed)
    theirs, ours = Scripted(script), Ours(compiled, script)
    plain = Pace(theirs, DT, ROUGH_BY)
    for command in commands:
        if theirs.calls > 300:
            break
        begun, status = theirs.calls, plain.advance(*command)
        assert ours.advance(*command) == status
        assert ours.steps() == theirs.steps, f"from step {begun} on"
        assert (ours.loop.size, ours.drive.dt) == (plain.size, theirs.dt)
        assert np.array_equal(ours.q, theirs.q)
        assert np.array_equal(ours.v, theirs.v)
        if status:
            break
    assert np.all(ours.saved[-2:] == 7.0), "written beyond the room"


def test_a_script_reaches_every_decision_on_the_step():
    """Over all seeds, the scripts contain repeated steps, steps of all sizes, and all statuses."""
    sizes, decisions = set(), set()
    for seed in range(SEEDS):
        script, commands = drawn(seed)
        steps = Scripted(script)
        pace, status = Pace(steps, DT, ROUGH_BY), 0
        for command in commands:
            if status == 0 and steps.calls <= 300:
                status = pace.advance(*command)
        decisions.add(status)
        sizes |= {round(step / DT * FINEST) for step in steps.steps if step > GLANCE}
    assert sizes == {1, 2, 4, 8, 16, 32, 64}
    assert decisions == {0, 1, 2}
