"""Logs of a simulator of other laws: held-out runs take a wrong name back, and a large residual is something that acts.

Only the candidates that matter are weighed, so that a log takes half a minute.
"""

from pathlib import Path

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import search_of, verdict_of
from rover_pin.discrepancy.decision import decide
from rover_pin.experiments.drive_log.loop_data import DriveLogData
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.simulation.model.effect_files import known_effects

LOGS = Path(__file__).with_name("outside")


def quiet(said):
    pass


def answered(log, *names):
    """Return what the evidence alone would answer, and the verdict, with candidates of these classes."""
    kinds = [kind for kind in known_effects() if kind.__name__ in names]
    assert len(kinds) == len(names)
    question = DriveLogData(read_drive_log(LOGS / log)).question(kinds)
    beliefs = search_of(question, quiet).beliefs()
    return decide(beliefs), verdict_of(question, beliefs, quiet)


@pytest.mark.slow
def test_a_bias_that_predicts_pitch_worse_gives_way_to_the_tether():
    """Gaps of the tracker let the evidence prefer a bias of pitch, with which other runs pitch wrongly."""
    evidence, verdict = answered("tether-with-outages", "SensorBias", "TetherDrag")
    assert (evidence.answer, evidence.retained) == (Answer.NAMED, ("SensorBias[body_pitch]",))
    assert (verdict.answer, verdict.named) == (Answer.LIKE, ("TetherDrag",))
    (reason,) = verdict.as_dict()["overturned"]
    assert "SensorBias[body_pitch]" in reason
    assert "body_pitch larger" in reason
    assert reason in verdict.sentence
    assert verdict.share > 0.0
    (bias,) = [one for one in verdict.as_dict()["posterior"]["sets"] if one["causes"] == ["SensorBias[body_pitch]"]]
    assert bias["held_out_gain"]["total"] < 2.0 * bias["held_out_gain"]["scatter"]


@pytest.mark.slow
def test_sand_that_grows_firmer_is_not_a_bent_ground():
    evidence, verdict = answered("firmer-sand", "BentGround", "HardPatch")
    assert (evidence.answer, evidence.retained) == (Answer.NAMED, ("BentGround",))
    assert (verdict.answer, verdict.named, verdict.effects) == (Answer.NONE_FITS, (), ())
    assert "BentGround" in verdict.overturned[0]
    assert verdict.model == verdict.before.model


@pytest.mark.slow
def test_motors_that_obey_late_are_something_that_acts():
    """The learnt noise of some channel is several times the scatter of its samples: no noise is."""
    _, verdict = answered("motor-dead-time", "TrackingDelay")
    assert (verdict.answer, verdict.named) == (Answer.NONE_FITS, ())
    assert max(verdict.beyond_noise.values()) > 3.0
    assert verdict.as_dict()["beyond_noise"] == verdict.beyond_noise
    assert f"{max(verdict.beyond_noise.values()):.1f} times" in verdict.sentence
