"""How a candidate moves a fitted model: sizes at which it is tried, its column for one u, and where a refit starts."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.signature import REDUCED_SIZE, Signature, signatures
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.estimation.fit import Task, fit
from rover_pin.inference.cause import SIZE_SD
from tests.inference import linear_search as toys

RATE, SIZE = Candidate("RateDependence", RateDependence(), ("RateDependence.c_r",)), "RateDependence.c_r"
BOUNDS = quantities(RateDependence)["c_r"]


def started(candidate, amplitudes, u, share=1.0):
    return Signature(candidate, amplitudes, np.zeros(1), share).start_numbers(u)


# --- where a refit starts --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_refit_starts_within_the_bounds(sign):
    size = 0.9 * (BOUNDS.high if sign > 0 else -BOUNDS.low) or 0.5
    initial = started(RATE, {SIZE: sign * size}, 1.5)[SIZE]
    assert initial == (BOUNDS.high if sign > 0 else BOUNDS.low)


# --- what is moved ---------------------------------------------------------------------------------------------------


def test_signatures_are_what_default_sizes_move():
    experiment = toys.made("pq", seed=2)
    base = toys.fitted(experiment)
    signature_list = signatures(base, [toys.candidate(name) for name in "pq"])
    for name, row in zip("pq", signature_list, strict=True):
        assert row.candidate.name == name
        assert row.shift == pytest.approx(experiment.columns[name], abs=1e-9)
        assert row.column == pytest.approx(SIZE_SD * row.shift)
        cause = row.candidate.cause.parameters[0]
        assert cause.value(1.0) == SIZE_SD * row.amplitudes[cause.name]
    assert signatures(base, []) == []


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
    assert [row.share for row in rows] == [REDUCED_SIZE, 1.0]
    assert rows[0].amplitudes == {"p.a": REDUCED_SIZE}
    assert rows[0].column == pytest.approx(SIZE_SD * experiment.columns["p"], abs=1e-9)
    assert rows[0].start_numbers(0.05) == {"p.a": pytest.approx(0.1)}


def test_a_freed_number_moves_by_its_slope():
    """What the base has fitted already is its own signature, over the size of the released number."""
    experiment = toys.made("p", {"p": 0.5}, seed=4)
    model = toys.Model().having(toys.Effect("p", 0.0))
    is_known = replace(toys.NUMBER, name="p.a", scale=0.25)
    base = fit(Task(experiment, experiment.noise()), model, [is_known])
    released = Candidate("p", toys.Effect("p"), ("p.a",), released=is_known)
    (row,) = signatures(base, [released])
    assert row.shift == pytest.approx(experiment.columns["p"], abs=1e-9)
    assert (row.amplitudes, row.moved) == ({"p.a": 1.0}, "p.a")
    assert released.on(model) is model
