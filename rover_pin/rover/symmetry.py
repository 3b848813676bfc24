"""The mirror symmetry of a rover about the x-z plane of its base."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.rover.description.readers import axes_at_zero

SAME = 1e-6
"""Largest difference between the mass matrix and its mirror image, over its largest entry."""


class Mirror(NamedTuple):
    """The image in the body's x-z plane: v_mirrored = sign * v[perm]; perm [nv], sign [nv]."""

    perm: np.ndarray
    sign: np.ndarray


def mirror(model: pin.Model, pairs: Sequence[tuple[str, str]]) -> Mirror:
    """Return the mirror image's permutation and signs, from pairs of joints (left, right).

    Angular velocities mirror as (-x, y, -z): a joint's sign follows from its axis and its partner's at zero angles. A
    joint in the middle is its own partner.
    """
    perm, sign = np.arange(model.nv), np.ones(model.nv)
    sign[[1, 3, 5]] = -1.0
    axes = axes_at_zero(model)
    for left, right in pairs:
        a, b = (model.joints[model.getJointId(joint)].idx_v for joint in (left, right))
        image = axes[a] * [-1.0, 1.0, -1.0]
        perm[a], perm[b] = b, a
        sign[a] = sign[b] = 1.0 if image @ axes[b] > 0.0 else -1.0
    return Mirror(perm, sign)


def is_symmetric(model: pin.Model, image: Mirror) -> bool:
    """Return whether left and right weigh the same in the same places: the mass matrix equals its mirror image."""
    upper = np.triu(pin.crba(model, model.createData(), pin.neutral(model), pin.Convention.WORLD))
    mass = upper + np.triu(upper, 1).T
    mirrored = np.outer(image.sign, image.sign) * mass[np.ix_(image.perm, image.perm)]
    return bool(np.max(np.abs(mirrored - mass)) <= SAME * np.max(np.abs(mass)))
