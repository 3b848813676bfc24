"""Refits from the declared numbers where the base fit bent them: on a experiment whose effect acts only near there."""

import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rover_pin.discrepancy.calibration import BENT, as_declared, declared_start, is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.refit_candidates import refit
from rover_pin.discrepancy.screen import score, signatures
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.estimation.fit import Task, fit
from rover_pin.simulation.model.model import Model

_spec = importlib.util.spec_from_file_location("linear_drive", Path(__file__).parent / "linear_drive.py")
linear = sys.modules.setdefault("linear_drive", importlib.util.module_from_spec(_spec))
_spec.loader.exec_module(linear)

SD = 0.03
"""Of phi, as declared."""
TRUE = 0.25
EXIT = Candidate("ExitAngle", ExitAngle(), ("ExitAngle.e_1",))


@dataclass(frozen=True)
class StuckExperiment(linear.LinearExperiment):
    """The effect stops the rover at the declared phi; where phi is far too low nothing moves and it changes nothing."""

    def _features(self, records):
        zero, along = self.slopes["soil.phi"]
        phi = float(records["soil"].phi)
        acts = np.exp(-(((phi - zero) / (2.0 * SD)) ** 4))
        e_1 = float(records["ExitAngle"].e_1) if "ExitAngle" in records else 0.0
        return (phi - zero) * along + acts * e_1 * self.slopes["ExitAngle.e_1"][1]


def stuck(e_1):
    """The fit of a base without the effect to a log in which it acts, mostly along what a lower phi does."""
    random = np.random.default_rng(5)
    (phi, _), model = linear.nuisances(), linear.MODEL
    along = random.normal(size=linear.SHAPE)
    across = random.normal(size=linear.SHAPE)
    columns = {
        "soil.phi": (phi.origin, 8.0 * along / SD),
        "ExitAngle.e_1": (0.0, (-150.0 * along + 15.0 * across) / 1.0),
    }
    seen = e_1 * columns["ExitAngle.e_1"][1] + random.normal(size=linear.SHAPE)
    experiment = StuckExperiment(seen, columns, linear.runs_of(linear.SHAPE))
    return fit(Task(experiment, linear.white()), model, (phi,))


def chi2_of_truth(base):
    """What the true numbers leave."""
    true = linear.MODEL.having(ExitAngle(e_1=TRUE))
    return float(np.sum(base.task.rows(base.task.experiment.predict([true])[0]) ** 2))


def fee(candidate):
    return 10.0


def quiet(said):
    pass


def scored_at(start):
    return score(start, signatures(start, [EXIT]))


def test_absorbed_effect_is_found_from_the_declared_numbers():
    base = stuck(TRUE)
    assert base.u[0] < -4.0
    assert is_bent(base)
    alone = refit(base, scored_at(base), fee, quiet)
    assert not any(one.accepted for one in alone), "from the base's optimum there is no way down"
    lines = []
    (found,) = refit(base, scored_at(base), fee, lines.append, declared_start(base, [EXIT]))
    assert found.accepted
    assert found.fit.value("ExitAngle.e_1") == pytest.approx(TRUE, rel=0.02)
    assert found.fit.chi2 < 1.05 * chi2_of_truth(base)
    assert found.gain == pytest.approx(base.chi2 - found.fit.chi2), "judged against the base, not against the start"
    assert any("from the declared numbers" in line for line in lines)


def test_numbers_within_what_is_declared_are_not_bent():
    base = stuck(0.0)
    assert np.abs(base.u).max() < BENT
    assert not is_bent(base)


def test_restart_resets_numbers_with_priors_and_keeps_sizes():
    base = stuck(TRUE)
    model: Model = EXIT.on(base.model)
    parameters = (*base.parameters, *EXIT.parameters)
    whole = fit(base.task, model, parameters, np.array([-1.0, 0.4]))
    start = as_declared(whole)
    assert start.u.tolist() == [0.0, whole.u[1]]
    assert start.value("soil.phi") == base.parameters[0].origin
    np.testing.assert_array_equal(start.predicted, base.task.experiment.predict([start.model])[0])
