"""How probable sets of causes are before anything is measured: by how many there are, and what they leave."""

import math

from rover_pin.inference.error_model import Discrepancy

ALLOWED = {
    False: {Discrepancy.NONE: 0.7, Discrepancy.SMOOTH: 0.3},
    True: {Discrepancy.NONE: 0.6, Discrepancy.FORM: 0.2, Discrepancy.SMOOTH: 0.2},
}
"""Prior probability of each kind of discrepancy, of a base model and of one with causes (assumed)."""
COUNTS = 0.5, 0.3, 0.14, 0.05, 0.01
"""Prior probability of no to four missing causes, shared evenly by all sets of as many (assumed)."""


def log_prior(count: int, choice: int, discrepancy: Discrepancy) -> float:
    """Return the logarithm of the prior probability of a set of `count` causes of a `choice`, with what it leaves."""
    allowed = ALLOWED[count > 0][discrepancy]
    return math.log(COUNTS[count] * allowed / math.comb(max(choice, count), count))
