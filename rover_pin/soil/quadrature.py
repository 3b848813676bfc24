"""Quadrature on the contact arc: Gauss-Legendre nodes in u, moved by a polynomial map psi(u) towards the arc's ends.

The stress starts as (theta_1 - theta)^n, with n not an integer, so plain Gauss-Legendre stalls at 1e-3. A map whose
slope vanishes at the singular end makes the integrand smooth there for every n, with weights that do not depend on n:
the exponent may be a symbol.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import ParameterError

FAST = 16
"""Nodes of one panel for simulation.

Table 1's angles: driving 2e-10 for k = 50 mm, 3e-9 for 5 mm, 3e-7 for 1 mm; braking, where j changes sign inside the
arc, 7e-7 of f_n for 50 mm, 2e-5 for 5 mm and 4e-4 for 1 mm. Over the box of the tests: driving 5e-5;
braking 8e-3 of f_n in 99 of 100 cases, up to 0.06 of it in corners (0.035 at k = 1 mm, theta_1 = 69 deg, S = -0.23),
more than all of a torque whose parts cancel there.
"""


class Graded(NamedTuple):
    """A rule on [0, 1]: integral of g = sum of weights g(psi)."""

    psi: tuple[float, ...]
    weights: tuple[float, ...]


@lru_cache(maxsize=64)
def entry_graded(nodes: int) -> Graded:
    """Rule for a singular start: psi = 5 u^4 - 4 u^5, d psi = 20 u^3 (1 - u) du."""
    return map_rule(nodes, lambda u: u**4 * (5 - 4 * u), lambda u: 20 * u**3 * (1 - u))


@lru_cache(maxsize=64)
def cubic_graded(nodes: int) -> Graded:
    """Rule for a singular start and an ordinary end: psi = u^3, d psi = 3 u^2 du."""
    return map_rule(nodes, lambda u: u**3, lambda u: 3 * u**2)


def map_rule(nodes: int, psi: Callable[[np.ndarray], np.ndarray], slope: Callable[[np.ndarray], np.ndarray]) -> Graded:
    """Return the rule of a map psi on [0, 1], given with its derivative."""
    if not isinstance(nodes, int) or isinstance(nodes, bool) or nodes < 2:
        raise ParameterError(f"nodes = {nodes!r} is not allowed: the arc needs a whole number of 2 nodes or more.")
    x, w = np.polynomial.legendre.leggauss(nodes)
    u = (x + 1) / 2
    return Graded(tuple(psi(u).tolist()), tuple((w / 2 * slope(u)).tolist()))
