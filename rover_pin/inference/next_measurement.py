"""The next measurement: what of several would tell most about which causes act, as the information expected of it.

A set of causes i of probability w_i expects N(m_i, C_i) of it: m_i as fitted, C_i = noise + J V J' with V the
covariance of its numbers. Of which set it is, the measurement tells at least
    I = -sum_i w_i ln sum_j w_j exp(-B_ij) nats, B Bhattacharyya's distance, C = (C_i + C_j) / 2:
    B_ij = (m_i - m_j)' C^-1 (m_i - m_j) / 8 + ln|C| / 2 - ln|C_i| / 4 - ln|C_j| / 4.
That is between 0, where all expect the same, and what is open, -sum_i w_i ln w_i, where no two do.
Source: Lindley, Ann. Math. Stat. 27 (1956) 986; Kolchinsky and Tracey, Entropy 19 (2017) 361, their lower bound.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from rover_pin.estimation.profile import MOST, SURE
from rover_pin.estimation.wording import MAX_LISTED, WORTH
from rover_pin.inference.beliefs import Beliefs, Hypothesis
from rover_pin.inference.outlook import Expected, Offer, expectation, with_uncertain_numbers

CLOSER = 4
"""Offers, of those that would tell most if all numbers were known, of which what is uncertain is worked out."""


class NextMeasurement(NamedTuple):
    """What to measure next, and what it is expected to tell."""

    sets: tuple[str, ...]
    "what is to be distinguished, the most probable first"
    what: str
    channel: str
    "the one that tells most"
    nats: float
    open_nats: float

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        first, *others = self.sets[:MAX_LISTED]
        others += ["others"] if len(self.sets) > MAX_LISTED else []
        return (
            f"to tell {first} from {' or '.join(others)}: {self.what}; expected to settle "
            f"{self.nats / self.open_nats:.0%} of what is open, {self.channel} the most of it"
        )


def open_sets(beliefs: Beliefs) -> list[tuple[float, Hypothesis]]:
    """Return the most probable sets that were fitted, as many as hold SURE of what is probable, with their shares.

    Their shares sum to 1.
    """
    rows = ((share, beliefs.best(tuple(names))) for names, share in beliefs.sets.items())
    fitted = [(share, best) for share, best in rows if best.is_fitted]
    before = np.cumsum([0.0, *(share for share, _ in fitted)])
    leading = [row for at, row in enumerate(fitted) if at < 2 or before[at] < SURE]
    total = sum(share for share, _ in leading)
    return [(share / total, hypothesis) for share, hypothesis in leading]


def next_measurement(
    leading: Sequence[tuple[float, Hypothesis]],
    offers: Iterable[Offer],
    progress: Callable[[str], None] = lambda message: None,
) -> NextMeasurement | None:
    """Return what would tell most of which of the sets it is; None where nothing of what is offered tells any.

    Channels that were not measured so far are asked for where the others tell less than half as much.
    """
    if len(leading) < 2:
        return None
    weights = np.array([share for share, _ in leading])
    hypotheses = [hypothesis for _, hypothesis in leading]
    if_known: list[tuple[float, Offer, list[Expected]]] = []
    for offer in offers:
        progress(f"predicting {offer.label}")
        expected = [expectation(offer, hypothesis, hypotheses[0]) for hypothesis in hypotheses]
        if_known.append((_best(weights, offer, expected, offer.unmeasured).nats, offer, expected))
    choices: list[_Choice] = []
    for _, offer, known in sorted(if_known, key=lambda row: -row[0])[:CLOSER]:
        progress(f"weighing {offer.label}")
        expected = [with_uncertain_numbers(offer, *pair) for pair in zip(hypotheses, known, strict=True)]
        choices += [_best(weights, offer, expected, offer.unmeasured), _best(weights, offer, expected)]
    open_nats = float(-np.sum(weights * np.log(weights)))
    measured, best = _greatest(choices[::2]), _greatest(choices)
    best = measured if measured.nats >= MOST * best.nats else best
    if best.nats < WORTH * open_nats:
        return None
    sets = tuple(" + ".join(hypothesis.names) or "nothing" for hypothesis in hypotheses)
    return NextMeasurement(sets, best.what, best.channel, best.nats, open_nats)


class _Choice(NamedTuple):
    """What a measurement is expected to tell, in words, and the channel that tells most."""

    nats: float
    what: str = ""
    channel: str = ""


def _greatest(choices: Sequence[_Choice]) -> _Choice:
    return max(choices, key=lambda choice: choice.nats, default=_Choice(0.0))


def _best(weights: np.ndarray, offer: Offer, expected: Sequence[Expected], without: Sequence[str] = ()) -> _Choice:
    """Return what the fold of an offer tells that tells most, some channels left out."""
    fold, channel, _ = np.nonzero(offer.noise.good)
    used = ~np.isin(channel, [offer.experiment.channels.index(name) for name in without])
    foreseen = np.all([np.isfinite(outlook.mean) for outlook in expected], axis=0)
    folds = [used & (fold == at) for at in range(len(offer.experiment.folds))]
    nats = [_information(weights, expected, rows) if foreseen[rows].all() else 0.0 for rows in folds]
    at = int(np.argmax(nats))
    by_channel = [_information(weights, expected, folds[at] & (channel == which)) for which in range(channel.max() + 1)]
    also = offer.in_addition if len(without) < len(offer.unmeasured) else ""
    return _Choice(nats[at], offer.experiment.folds[at] + also, offer.experiment.channels[int(np.argmax(by_channel))])


def _information(weights: np.ndarray, expected: Sequence[Expected], rows: np.ndarray) -> float:
    if not rows.any():
        return 0.0
    mean, covariance = zip(*(outlook.at(rows) for outlook in expected), strict=True)
    return information(weights, np.array(mean), np.array(covariance))


def information(weights: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    """Return how much N(mean[i], covariance[i]), (sets, n) and (sets, n, n), tells at least of which i it is [nats]."""
    size = np.linalg.slogdet(covariance)[1]
    distance = np.empty((len(weights),) * 2)
    for at, center in enumerate(mean):
        both = (covariance[at] + covariance) / 2
        difference = center - mean
        squares = np.sum(difference * np.linalg.solve(both, difference[..., None])[..., 0], axis=1)
        distance[at] = squares / 8 + np.linalg.slogdet(both)[1] / 2 - (size[at] + size) / 4
    return max(0.0, -float(weights @ logsumexp(-distance, b=weights[None], axis=1)))
