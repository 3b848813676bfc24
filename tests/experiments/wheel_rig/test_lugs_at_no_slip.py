"""Lugs at S = 0, held to two measured wheels of one sand: `Grousers` pulls there only where r is the rim's.

The lugged wheel's folder does not say whether r is over the lugs. Both readings are fitted together with the smooth
wheel: one soil, slip-softening, the trench of the lugs, a rim that slides and a rate; lugs 5 mm high.
"""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin.effects.grousers import Grousers
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.experiments.wheel_rig.candidates import present_amplitudes
from rover_pin.experiments.wheel_rig.checks import findings
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, join_sets
from rover_pin.experiments.wheel_rig.model import PAPER
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import calibrated

DATA = Path(__file__).parents[3] / "studies" / "data"
SMOOTH, LUGGED = DATA / "cmu-smooth-wheel", DATA / "cmu-grousered-wheel"
LAWS = (SlipSoftening(), LugExcavation(h_l=0.005), InterfaceFriction(), RateDependence(v_0=0.05))


def over_lugs(folder, message="true"):
    """A copy of the lugged wheel that says over what its radius is told."""
    shutil.copytree(LUGGED, folder / LUGGED.name)
    file = folder / LUGGED.name / "rig.toml"
    text = file.read_text()
    file.write_text(text.replace('surface = "grousered"\n', f'surface = "grousered"\nr_over_lugs = {message}\n'))
    return folder / LUGGED.name


def fitted(lugged, lambda_s):
    """chi2 with pressings, and the mean error of the pull at S = 0 [N], of the smooth wheel and of the lugged one."""
    joint = join_sets([read_rig_set(SMOOTH), read_rig_set(lugged)])
    effects = (*PAPER, *LAWS, Grousers(h_s=0.005, lambda_s=lambda_s))
    model = dataclasses.replace(joint.base_model(), effects=effects)
    uncertain = joint.uncertain(model)
    free = tuple(
        present_amplitude
        for present_amplitude in (*uncertain, *present_amplitudes(model.effects, uncertain))
        if not present_amplitude.name.endswith("h_s")
    )
    fit = calibrated(joint, model, free)
    left, pull = (joint.observed - joint.predict([fit.model])[0]), list(joint.channels).index("drawbar pull")
    return float(fit.chi2), [float(np.nanmean(left[joint.of_set(name)][0, pull])) for name in joint.runs]


def at_no_slip(folder):
    points = pd.read_csv(folder / "points.csv").query("level == 10")
    share = points["drawbar_pull_N"] / points["load_N"]
    return share.mean(), share.std() / len(points) ** 0.5


def test_both_wheels_pull_alike_at_no_slip():
    (smooth, its_sd), (lugged, sd) = at_no_slip(SMOOTH), at_no_slip(LUGGED)
    assert [smooth, its_sd, lugged, sd] == pytest.approx([-0.054, 0.007, -0.055, 0.005], abs=5e-4)
    assert abs(lugged - smooth) < np.hypot(sd, its_sd)


def test_law_holds_for_both_wheels_at_no_slip_with_outer_r(tmp_path):
    """A mean of three runs scatters by 0.2 N."""
    without, _ = fitted(LUGGED, 0.0)
    chi2, errors = fitted(over_lugs(tmp_path), 0.5)
    assert np.abs(errors) == pytest.approx(0.0, abs=0.2)
    assert (without, chi2) == pytest.approx((183.1, 175.7), abs=0.5)


def test_law_with_rim_r_predicts_a_lug_pull_unlike_measured():
    chi2, (smooth, lugged) = fitted(LUGGED, 0.5)
    assert chi2 == pytest.approx(209.2, abs=0.5)
    assert lugged == pytest.approx(-0.95, abs=0.05)
    assert smooth == pytest.approx(0.42, abs=0.05)


@pytest.mark.nightly
def test_half_way_up_the_lugs_is_the_best_of_their_height(tmp_path):
    """0 at the rim, 1 at the tips; a parabola through these has its least at 0.48."""
    folder = over_lugs(tmp_path)
    chi2 = [fitted(folder, value)[0] for value in (0.0, 0.5, 1.0)]
    assert chi2 == pytest.approx([191.7, 175.7, 197.5], abs=0.5)


def test_a_wheel_that_does_not_say_is_told_of(tmp_path):
    finding_texts = [str(finding) for finding in findings(RigExperiment((read_rig_set(LUGGED),)))]
    assert any("lug_height" in finding_text and "r_over_lugs" in finding_text for finding_text in finding_texts)
    for value in ("true", "false"):
        finding_texts = findings(RigExperiment((read_rig_set(over_lugs(tmp_path / value, value)),)))
        assert not any("r_over_lugs" in str(finding_text) for finding_text in finding_texts)
    assert not any("r_over_lugs" in str(finding) for finding in findings(RigExperiment((read_rig_set(SMOOTH),))))
