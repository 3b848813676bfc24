"""What a wheel rig is offered to measure next, and that the loop proposes it where it cannot tell."""

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.wheel_rig.sets import read_joint
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.rig import question_of
from tests.loop.test_first_steps import written

PLAIN = "slip,load_N,drawbar_pull_N,sinkage_m"


@pytest.mark.slow
def test_loop_proposes_a_run_where_several_sets_are_left():
    verdict = close_the_loop("cmu-smooth-wheel")
    assert verdict.answer in (Answer.SET, Answer.CANNOT_TELL)
    (proposed,) = verdict.experiments
    assert set(proposed.sets) >= set(verdict.indistinguishable[:1])
    assert 0.0 < proposed.nats <= proposed.open_nats
    assert proposed.sentence in verdict.summary()


def test_several_sets_offer_the_runs_of_each(tmp_path):
    first = written(tmp_path / "first", f"{PLAIN},slip_angle_rad", ("0.1,25,1,0.01,0", "0.4,25,2,0.02,0.2"))
    second = written(tmp_path / "second", "slip,load_N,drawbar_pull_N", ("0.1,40,1", "0.4,40,2"))
    for folder in (first, second):
        (folder / "rig.toml").write_text(f'name = "{folder.name}"\n' + (folder / "rig.toml").read_text())
    joint = read_joint((first, second))
    (offer,) = question_of(joint, joint.base_model(), ()).offers(())
    assert len(offer.experiment.folds) == 2 * 33 + 33
    assert "second: one run at S = 0.4 under 80 N" in offer.experiment.folds
    assert np.isfinite(offer.experiment.predict([joint.base_model()])[0][offer.noise.good]).any()
    assert offer.noise.count == 2 * 33 * 2 + 33
