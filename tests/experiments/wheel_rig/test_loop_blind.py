"""Many hidden effects from the plain generator, with right and wrong nominal soils: how often the loop is right."""

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.loop.close import close_the_loop
from tests.oracle import rig_generator as hidden

EFFECTS = ("slip_sinkage", "exit_angle", "peak_stress", "motion_resistance", "post_peak", "rate_dependence", "digging")
SOILS = ({}, {"n": 0.9, "K": 6e4, "phi": 0.6, "k": 0.015}, {"n": 1.3, "K": 2e5, "phi": 0.45, "c": 50.0, "k": 0.004})


def verdict_of(folder, effect, seed, severity=1.0):
    rig = hidden.Rig(effect, severity * hidden.SIZES[effect], **SOILS[seed % 3])
    path = hidden.write(folder, rig, hidden.rig_set(rig, seed=seed), hidden.WRONG if seed % 2 else None)
    return close_the_loop(path)


@pytest.mark.nightly
def test_hidden_effects_are_named_or_within_the_stated_set(tmp_path):
    """A miss counts where the true effect has 3 nats of evidence more than the base."""
    wrong, missed, hidden_well = [], [], []
    for effect in EFFECTS:
        for seed in range(4):
            verdict = verdict_of(tmp_path / f"{effect}{seed}", effect, seed, severity=(1.0, 0.5)[seed // 2])
            is_named = verdict.answer in (Answer.NAMED, Answer.SET, Answer.LIKE)
            alone, base = (verdict.beliefs.best(names).log_evidence for names in ((hidden.IS[effect],), ()))
            detectable = alone - base > 3.0
            case = (effect, seed, verdict.answer.name, verdict.indistinguishable, round(verdict.before.misfit, 2))
            if is_named and hidden.IS[effect] not in " ".join(verdict.indistinguishable):
                wrong.append(case)
            elif not is_named:
                (missed if detectable else hidden_well).append(case)
    print(f"of {4 * len(EFFECTS)}: wrong {wrong}, missed {missed}, too small to see {hidden_well}")
    assert wrong == []
    assert missed == []
    assert len(hidden_well) <= 3


@pytest.mark.nightly
def test_null_sets_raise_no_alarm(tmp_path):
    alarms = []
    for seed in range(20):
        verdict = verdict_of(tmp_path / f"none{seed}", "none", seed)
        if verdict.answer is not Answer.NONE_NEEDED:
            alarms.append((seed, verdict.answer.name, verdict.indistinguishable))
    print(f"{len(alarms)} of 20 false alarms: {alarms}")
    assert len(alarms) <= 1, alarms


@pytest.mark.nightly
def test_what_is_on_no_list_is_not_named(tmp_path):
    named = []
    for effect in ("slip_squared_drag", "sinkage_bump"):
        for seed in range(4):
            verdict = verdict_of(tmp_path / f"{effect}{seed}", effect, seed)
            if verdict.answer is not Answer.NONE_FITS:
                named.append((effect, seed, verdict.answer.name, verdict.indistinguishable, round(verdict.share, 2)))
    print(f"{len(named)} of 8 off-list sets named: {named}")
    assert len(named) <= 2, named
