"""How a candidate moves a fitted model: sizes at which it is tried, its column for one u, and where a refit starts."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.signature import FARTHEST, MULTIPLES, SMALL, Signature, signatures, trials
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.estimation.fit import Task, fit
from rover_pin.inference.cause import SIZE_SD
from tests.inference import linear_search as toys

TILT = "GravityTilt.rise_x", "GravityTilt.rise_y"
LIMIT = "TorqueSaturation.i_max"
RATE, SIZE = Candidate("RateDependence", RateDependence(), ("RateDependence.c_r",)), "RateDependence.c_r"
BOUNDS = quantities(RateDependence)["c_r"]


def limit(i_max=2.0, **more):
    return Candidate("TorqueSaturation", TorqueSaturation(i_max=i_max), (LIMIT,), **more)


def started(candidate, amplitudes, u, share=1.0):
    return Signature(candidate, amplitudes, np.zeros(1), share).started(u)


# --- sizes that are tried --------------------------------------------------------------------------------------------


def test_sizes_are_tried_singly_but_jointly_in_a_place_search():
    tilt = Candidate("GravityTilt", GravityTilt(rise_x=0.02, rise_y=0.03), TILT)
    one_by_one = [{TILT[0]: 0.02, TILT[1]: 0.0}, {TILT[0]: 0.0, TILT[1]: 0.03}]
    assert trials(tilt) == [pytest.approx(each) for each in one_by_one]
    together = replace(tilt, place="1.0", place_searched=True)
    assert trials(together) == [pytest.approx({TILT[0]: 0.02, TILT[1]: 0.03})]


@pytest.mark.parametrize("sought", [False, True])
def test_limit_effect_is_tried_at_several_sizes_also_by_place(sought):
    """Neutral at 1,000 A is far off: the size is sought by ratios of its default."""
    tried = [each[LIMIT] for each in trials(limit(place_searched=sought))]
    assert tried == pytest.approx([2.0 * multiple for multiple in MULTIPLES])
    assert MULTIPLES == (0.8, 1.2, 1.8, 2.7)


# --- where a refit starts --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("u", "value"), [(0.25, 0.85), (-0.25, 1.15), (4.5, 0.1), (-4.5, 1.9)])
def test_refit_starts_at_the_estimate_within_three_sizes(u, value, monkeypatch):
    monkeypatch.setitem(RateDependence.neutral, "c_r", 1.0)
    monkeypatch.setattr(type(RATE), "size", lambda self, name: replace(toys.NUMBER, low=-9.0, high=9.0))
    assert started(RATE, {SIZE: 0.7}, u) == {SIZE: pytest.approx(value)}
    assert FARTHEST == 3.0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_refit_starts_within_the_bounds(sign):
    size = 0.9 * (BOUNDS.high if sign > 0 else -BOUNDS.low) or 0.5
    found = started(RATE, {SIZE: sign * size}, 1.5)[SIZE]
    assert found == (BOUNDS.high if sign > 0 else BOUNDS.low)


def test_every_size_of_an_effect_starts_by_the_same_share():
    patch = Candidate("HardPatch", HardPatch(), ("HardPatch.g", "HardPatch.g_k"), place="1.0", place_searched=True)
    (sizes,) = trials(patch)
    found = started(patch, sizes, 0.2)
    for name in patch.amplitudes:
        assert found[name] == pytest.approx(patch.neutral[name] + 0.4 * (sizes[name] - patch.neutral[name]))
    assert Signature(patch, sizes, np.zeros(1)).moved == patch.amplitudes[0]
    alone = {**patch.neutral, "HardPatch.g_k": sizes["HardPatch.g_k"]}
    assert Signature(patch, alone, np.zeros(1)).moved == "HardPatch.g_k"


# --- what is moved ---------------------------------------------------------------------------------------------------


def test_signatures_are_what_default_sizes_move():
    experiment = toys.made("pq", seed=2)
    base = toys.fitted(experiment)
    found = signatures(base, [toys.candidate(name) for name in "pq"])
    for name, row in zip("pq", found, strict=True):
        assert row.candidate.name == name
        assert row.shift == pytest.approx(experiment.columns[name], abs=1e-9)
        assert row.column == pytest.approx(SIZE_SD * row.shift)
        cause = row.candidate.cause.parameters[0]
        assert cause.value(1.0) == SIZE_SD * row.amplitudes[cause.name]
    assert signatures(base, []) == []


def test_all_signatures_are_predicted_together():
    experiment = toys.made("pqr")
    base = toys.fitted(experiment)
    experiment.asked.clear()
    signatures(base, [toys.candidate(name) for name in "pqr"])
    assert experiment.asked == [3]


@dataclass(frozen=True, eq=False)
class Sinking(toys.Sums):
    """No sinkage carries the wheel where the effect p is larger than a fifth of its default."""

    def sum_of(self, model):
        """What one model predicts."""
        lost = any(getattr(record, "name", "") == "p" and record.a > 0.2 for _, record in model.records)
        return np.full(self.observed.shape, np.nan) if lost else super().sum_of(model)


def test_what_loses_a_prediction_is_tried_at_a_small_share():
    experiment = toys.made("pq", seed=2, of=Sinking)
    rows = signatures(toys.fitted(experiment), [toys.candidate(name) for name in "pq"])
    assert [row.share for row in rows] == [SMALL, 1.0]
    assert rows[0].amplitudes == {"p.a": SMALL}
    assert rows[0].column == pytest.approx(SIZE_SD * experiment.columns["p"], abs=1e-9)
    assert rows[0].started(0.05) == {"p.a": pytest.approx(0.1)}


def test_a_freed_number_moves_by_its_slope():
    """What the base has fitted already is its own signature, over the size of the released number."""
    experiment = toys.made("p", {"p": 0.5}, seed=4)
    model = toys.Model().having(toys.Effect("p", 0.0))
    known = replace(toys.NUMBER, name="p.a", scale=0.25)
    base = fit(Task(experiment, experiment.noise()), model, [known])
    released = Candidate("p", toys.Effect("p"), ("p.a",), released=known)
    (row,) = signatures(base, [released])
    assert row.shift == pytest.approx(experiment.columns["p"], abs=1e-9)
    assert (row.amplitudes, row.moved) == ({"p.a": 1.0}, "p.a")
    assert released.on(model) is model
