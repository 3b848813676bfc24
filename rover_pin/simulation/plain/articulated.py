"""The equations of a step for its stages (`composite.py`), solved with Pinocchio's articulated-body algorithm (ABA).

ABA computes M^-1 (tau - nle) without forming the mass matrix M, but it knows neither constraints nor forces that depend
on the speeds. These are added in three steps.

1. Forces on single joints, from motors, servos and end stops, act over a step like an additional rotor inertia.
   Pinocchio adds it to the inertia of the joint (`model.armature`), so that the mass matrix becomes A = M - dt (gamma
   D_motor + D_spring).
2. The forces of soil and body effects, which depend on the speeds of several joints, are the matrix E = dt (gamma
   D_soil + D_push). With the inverse A^-1, which Pinocchio computes by the same recursion as ABA
   (`pin.computeMinverse`), the equations (A - E) k = b become (I - A^-1 E) k = A^-1 b.
3. Each constraint is a correction of rank one: with the free solution k_0 and y = (I - A^-1 E)^-1 A^-1 G^T, the
   solution is k = k_0 + y lambda with lambda = -(G y)^-1 G (v + k_0). For one constraint, the differential, G y is a
   number.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 7.3 (ABA); Carpentier, Analytical Inverse of the
Joint Space Inertia Matrix (2018), for `pin.computeMinverse`.
"""

import numpy as np
import pinocchio as pin

from rover_pin.simulation.native.shared import GAMMA
from rover_pin.simulation.plain.composite import COUNT, StageEquations, Stages


def articulated_stages(equations: StageEquations) -> Stages:
    """Return the stages of a step, solved with Pinocchio's articulated-body algorithm (`pin.aba`) and a correction of
    rank one for each constraint.

    The result equals that of `composite_stages` up to round-off. The armature of the model is changed during the call,
    and restored before the function returns.
    """
    model, data, q, v, dt, G, force, slopes = equations
    # The model is lent the inertia by which motors, servos and end stops act.
    rotors = np.array(model.armature)
    model.armature = rotors - dt * (GAMMA * slopes.motor + slopes.spring)
    free = dt * np.array(pin.aba(model, data, q, v, force))
    inverse = np.array(pin.computeMinverse(model, data, q))
    model.armature = rotors
    # Forces that depend on the speeds of several joints, and the answer of the speeds to each constraint.
    coupled = np.eye(len(v)) - inverse @ (dt * (GAMMA * slopes.soil + slopes.push))
    answer = np.linalg.solve(coupled, inverse @ G.T)
    # M' differs from A by the motors, which are in A already, and by the body effects, which are not.
    to_next = np.eye(len(v)) - inverse @ (dt * (slopes.push - GAMMA * np.diag(slopes.motor)))
    changes, impulses = np.zeros((COUNT, len(v))), np.zeros((COUNT, len(G)))
    for stage in range(COUNT):
        unconstrained = np.linalg.solve(coupled, free)
        impulses[stage] = np.linalg.solve(G @ answer, -G @ (v + unconstrained))
        changes[stage] = unconstrained + answer @ impulses[stage]
        free = to_next @ changes[stage]
    return Stages(changes, impulses)
