"""The scores that blind tests take from a verdict: answered sets, stated probabilities, and the gain over
noise alone."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from blind_rig import REPORTED, generator, plan
from blind_test import more_than_noise
from kept import told

from rover_pin.inference.error_model import Discrepancy


def verdict(named, sets, included):
    return SimpleNamespace(named=named, indistinguishable=sets, beliefs=SimpleNamespace(included=included))


def test_a_place_on_the_way_is_no_part_of_an_answer():
    of = verdict(("HardPatch@0.3",), ("HardPatch@0.3 + ExitAngle", "nothing"), {"HardPatch@0.3": 0.97})
    assert told.alike_of(of) == (("HardPatch", "ExitAngle"), ("nothing",))
    assert told.inclusion_of(of, ["HardPatch"]) == {"HardPatch": 0.97}


def test_true_causes_are_kept_however_improbable():
    inclusion = told.inclusion_of(verdict((), (), {"A": 0.02, "B": 0.009, "C": 0.001}), ["C", "D"])
    assert inclusion == {"C": 0.001, "D": 0.0, "A": 0.02}


@pytest.mark.parametrize(("second", "nats"), [(5.0, 5.0), (-5.0, 0.0)])
def test_an_unlisted_effect_is_noticed_next_to_a_quiet_base(second, nats):
    rows = [SimpleNamespace(names=(), discrepancy=kind) for kind in (Discrepancy.NONE, Discrepancy.SMOOTH)]
    beliefs = SimpleNamespace(scores=np.array([0.0, second]), hypotheses=rows)
    assert math.isclose(more_than_noise(beliefs), nats)


def test_rigs_are_planned_under_every_kind_of_noise():
    """The kinds of noise come from the generator's list, which only this study uses."""
    planned = plan(REPORTED[0])
    assert len(planned) == 307
    assert {hidden.noise for hidden in planned} == set(generator().NOISES)
