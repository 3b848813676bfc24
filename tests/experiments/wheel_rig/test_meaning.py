"""Quick tests of meaning: an effect hidden by a generator that shares no code comes back under its own name and size.

Each set is small and few effects are candidates, so that one test takes seconds. Candidates whose names or numbers
were exchanged would fail here.
"""

import numpy as np
import pytest

from rover_pin import Soil, Wheel
from rover_pin.discrepancy.answer import Answer
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.loop.close import verdict_on as verdict_of_loop
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.rig_set import RigSet
from tests.oracle import rig_generator as hidden

KINDS = (SlipSinkage, MotionResistance, ExitAngle, Bulldozing)
SIZES = {
    "slip_sinkage": ("SlipSinkage.n_1", 0.6),
    "motion_resistance": ("MotionResistance.R", 0.08),
    "exit_angle": ("ExitAngle.e_1", 0.35),
}
"""What the generator hides, at its own sizes, and the number of the package that is this size."""


def small_set(effect, seed=3):
    rig = hidden.Rig(effect)
    columns = hidden.rig_set(rig, loads=(15.0, 40.0), slips=(0.0, 0.15, 0.35, 0.6, 0.8), repeats=2, seed=seed)
    kinds = ((DrawbarPull, "drawbar_pull_N"), (Torque, "torque_Nm"), (Sinkage, "sinkage_m"))
    channels = tuple(kind(columns[name], sd) for (kind, name), sd in zip(kinds, hidden.SD, strict=True))
    soil = {"n": rig.soil["n"], "c": rig.soil["c"]}
    speeds = np.column_stack([columns["travel_speed_mps"], columns["rim_speed_mps"]])
    return RigSet(
        Wheel(rig.r, rig.b), columns["slip"], columns["load_N"], channels, effect, declared=soil, speeds=speeds
    )


def verdict_on(effect):
    return verdict_of_loop(RigData(RigExperiment((small_set(effect),))), KINDS)


@pytest.mark.parametrize("effect", SIZES)
def test_a_hidden_effect_has_its_own_name_and_number(effect):
    verdict = verdict_on(effect)
    name, size = SIZES[effect]
    assert verdict.answer in (Answer.NAMED, Answer.SET)
    assert verdict.named == (name.partition(".")[0],)
    number = next(number for number in verdict.after.numbers if number.name == name)
    assert number.low <= size <= number.high
    assert number.value == pytest.approx(size, rel=0.3)


def test_where_nothing_is_hidden_the_soil_comes_back():
    verdict = verdict_on("none")
    assert verdict.answer is Answer.NONE_NEEDED
    soil = hidden.Rig("none").soil
    for name, truth in (("soil.phi", soil["phi"]), ("soil.k", soil["k"]), ("soil.k_1", soil["K"])):
        number = next(number for number in verdict.before.numbers if number.name == name)
        assert number.low <= truth <= number.high, name
    assert isinstance(verdict.model.soil, Soil)
