"""What an undeclared number imitates: how large it may be unseen, and when the data cannot tell it from nothing."""

from dataclasses import replace

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude
from tests.inference import linear_search as toys

SIZE, PRIOR = 12.0, 5.0
"""SDs by which a default size of each effect, or a unit of the number, moves the rows; prior SD of the number."""


def concluded(share, declared=False):
    """The verdict on noise; a share of the column of q is that of the base model's number."""
    experiment = toys.made("pqr", {}, size=SIZE, seed=4)
    base, own = experiment.columns["base"], experiment.columns["q"].copy()
    own -= base * np.sum(own * base) / SIZE**2
    experiment.columns["q"] = share * base + np.sqrt(1.0 - share**2) * own * SIZE / np.linalg.norm(own)
    number = replace(toys.NUMBER, scale=PRIOR, declared=declared)
    return experiment, conclude(toys.question(experiment, "pqr", number), lambda message: None)


def detectable(columns, priors):
    """Smallest size (3 SD) of the last column, of a linear model with these columns and prior SDs."""
    precision = columns @ columns.T + np.diag(1.0 / np.array(priors) ** 2)
    return 3.0 * np.sqrt(np.linalg.inv(precision)[-1, -1])


def test_what_the_number_imitates_is_stated_with_both_values():
    experiment, verdict = concluded(0.98)
    assert verdict.answer is Answer.NONE_NEEDED
    (row,) = verdict.equivalents
    columns = np.array([experiment.columns[name].ravel() for name in ("base", "q")])
    assert (row.name, row.parameter, row.unit) == ("q", "q.a", "N")
    assert row.size == pytest.approx(detectable(columns, (PRIOR, 2.0)), rel=1e-3)
    assert row.if_known == pytest.approx(detectable(columns[1:], (2.0,)), rel=1e-3)
    assert row.size > 1.0 > row.if_known
    assert row.has_information
    # The number makes room for the effect: together they predict nearly what the number alone predicts.
    (imitator,) = row.imitators
    assert imitator.name == "base.b"
    alone = imitator.without * columns[0]
    together = imitator.with_effect * columns[0] + row.size * columns[1]
    assert np.linalg.norm(together - alone) < 1.1 * np.linalg.norm(
        (np.eye(2) * row.size)[1] @ columns * np.sqrt(1 - 0.98**2)
    )
    assert verdict.as_dict()["equivalents"][0]["imitators"][0]["name"] == "base.b"


def test_a_column_that_the_number_shares_wholly_cannot_be_told_from_nothing():
    _, verdict = concluded(1.0 - 1e-6)
    assert verdict.answer is Answer.CANNOT_TELL
    assert verdict.indistinguishable == ("nothing", "q")
    assert not verdict.equivalents[0].has_information


@pytest.mark.parametrize("share", [0.98, 1.0 - 1e-6])
def test_a_declared_number_is_no_equivalent(share):
    _, verdict = concluded(share, declared=True)
    assert verdict.answer is Answer.NONE_NEEDED
    assert verdict.equivalents == ()


def test_effects_of_their_own_have_no_equivalent():
    assert concluded(0.0)[1].equivalents == ()
