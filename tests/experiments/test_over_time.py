"""Functions of time: inputs between rows, delays, initial states, and compiled equations that equal the plain ones."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from rover_pin.discrepancy.experiment import Parts
from rover_pin.experiments.over_time import OverTime, record

Tank = record("Tank", "a vessel", rate=(2.0, "1/s", 0.0, 50.0), level=(0.3, "m", -10.0, 10.0))
Late = record("Late", "the pump answers late", wait=(0.1, "s", 0.0, 2.0))
Bend = record("Bend", "the outlet bends", bend=(0.5, "1/(m s)", 0.0, 5.0))


@dataclass(frozen=True, eq=False)
class Filling(OverTime):
    """A first-order lag: level' = rate (u - level) - bend sin(level), written for arrays."""

    name, states, laws = "filling", 1, (Late, Bend)
    columns = "time_s pump level_m level_sd_m".split()
    units: ClassVar = {"level": "m"}
    parts: ClassVar = {"tank": Tank}
    uncertainty: ClassVar = {"tank.rate": 0.1}
    steps = 4

    def motion(self, n, state, *values):
        (level,), (pump,) = state, values
        return (n.rate * (pump - level) - n.bend * np.sin(level),), (level,)


class Compiled(Filling):
    """The same in CasADi."""

    is_symbolic = True

    def motion(self, n, state, *values):
        (level,), (pump,) = state, values
        return (n.rate * (pump - level) - n.bend * ca.sin(level),), (level,)


TIME = np.linspace(0.0, 3.0, 61)
PUMP = np.where(TIME < 0.5, 0.0, np.sin(3.0 * TIME))


def bench(of=Filling, time=TIME, pump=PUMP, runs=1, **more):
    """Some runs; the last one is shorter, so that its arrays are padded."""
    times, pumps = np.tile(time, (runs, 1)), np.tile(pump, (runs, 1, 1))
    if runs > 1:
        times[-1, -7:] = pumps[-1, :, -7:] = np.nan
    observed = np.where(np.isnan(times), np.nan, 0.0)[:, None]
    kind = type("Bench", (of,), more)
    return kind(
        Parts({"tank": Tank()}), tuple(f"run {at}" for at in range(runs)), times, pumps, observed, np.array([0.1])
    )


def exact(time, pump, rate, linear, delay=0.0, level=0.0):
    """Solution of level' = rate (u(t - delay) - level), by the sum over 2,000 parts of each interval."""
    fine = np.linspace(time[0], time[-1], 2000 * (len(time) - 1) + 1)
    middle = (fine[1:] + fine[:-1]) / 2 - delay
    if linear:
        u = np.interp(middle, time, pump)
    else:
        u = pump[np.maximum(np.searchsorted(time, middle, side="right") - 1, 0)]
    decay, levels = math.exp(-rate * (fine[1] - fine[0])), [level]
    for value in u:
        level = value + (level - value) * decay
        levels.append(level)
    return np.interp(time, fine, levels)


@pytest.mark.parametrize("of", [Filling, Compiled])
@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("delay", [0.0, 0.137])
def test_inputs_between_rows_and_their_delay(of, linear, delay):
    more = {"linear_inputs": ("pump",)} if linear else {}
    experiment = bench(of, delays={"pump": "wait"}, **more)
    model = experiment.base_model().having(Late(wait=delay))
    level = experiment.predict([model])[0, 0, 0]
    # Inside a step, a held input that changes has its mean there, and the bend of a linear one lies between two stages.
    off = 2e-3 if delay and not linear else 2e-5 + 2e-4 * delay
    assert level == pytest.approx(exact(TIME, PUMP, 2.0, linear, delay), abs=off)


@pytest.mark.parametrize("linear", [(), ("pump",)])
def test_compiled_equations_equal_the_plain_ones(linear):
    arguments = {"runs": 3, "delays": {"pump": "wait"}, "linear_inputs": linear, "free_start": {0: 0.5}}
    plain, compiled = bench(Filling, **arguments), bench(Compiled, **arguments)
    base = plain.base_model()
    models = [
        base,
        base.having(Bend(bend=1.7)),
        plain.with_values(base.having(Late(wait=0.33)), {"tank.rate": 5.0, "start.state_0_run_1": 0.4}),
    ]
    both = [experiment.predict(models) for experiment in (plain, compiled)]
    used = np.isfinite(plain.observed)
    assert both[0][:, used] == pytest.approx(both[1][:, used], abs=1e-12)
    assert np.isfinite(both).all()


@pytest.mark.parametrize("of", [Filling, Compiled])
def test_a_delay_changes_a_held_input_smoothly(of):
    """So that a fit finds it: the derivative at 1e-4 s is the one at 1e-2 s."""
    experiment = bench(of, delays={"pump": "wait"})
    base = experiment.base_model()
    waits = [0.1371, 0.1371 + 1e-4, 0.1371 + 1e-2]
    here, near, far = experiment.predict([base.having(Late(wait=wait)) for wait in waits])
    assert np.linalg.norm(near - here) / 1e-4 == pytest.approx(np.linalg.norm(far - here) / 1e-2, rel=0.1)


@pytest.mark.parametrize("of", [Filling, Compiled])
def test_initial_states_are_declared_estimated_or_free(of):
    still = np.zeros_like(TIME)
    assert bench(of, pump=still).predict([Parts({"tank": Tank()})])[0, 0, 0] == pytest.approx(still)
    declared = bench(of, pump=still, start=lambda self, n: (1.5,))
    assert declared.predict([declared.base_model()])[0, 0, 0] == pytest.approx(1.5 * np.exp(-2.0 * TIME), abs=1e-4)
    estimated = bench(of, pump=still, start=lambda self, n: (n.level,), uncertainty={"tank.level": 0.2})
    models = [estimated.base_model(), estimated.with_values(estimated.base_model(), {"tank.level": 0.6})]
    assert estimated.predict(models)[:, 0, 0, 0] == pytest.approx([0.3, 0.6])
    free = bench(of, pump=still, runs=3, start=lambda self, n: (n.level,), free_start={0: 0.5})
    model = free.with_values(free.base_model(), {"start.state_0_run_2": -0.1})
    assert free.predict([model])[0, :, 0, 0] == pytest.approx([0.3, 0.3, 0.2])
    names = [parameter.name for parameter in free.uncertain(free.base_model())]
    assert names == ["tank.rate", *(f"start.state_0_run_{run}" for run in range(3))]
    assert free.next_runs().predict([free.base_model()]).shape[1] == 4 * 3


def test_a_law_that_is_absent_has_its_neutral_numbers():
    compiled = bench(Compiled)
    base = compiled.base_model()
    assert np.array_equal(*compiled.predict([base, base.having(Bend(bend=0.0))]))


def test_a_model_that_diverges_is_a_bad_fit(tmp_path):
    compiled = bench(Compiled)
    model = compiled.base_model()
    stiff = replace(model, records={"tank": Tank().replace(rate=50.0)})
    experiment = bench(Compiled, time=100.0 * TIME)
    predicted = experiment.predict([stiff])
    assert np.isfinite(predicted).all()
    assert np.abs(predicted).max() == experiment.stand_in
