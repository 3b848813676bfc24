"""The equations of a step for its stages, and their solution with Pinocchio's composite-rigid-body algorithm (CRBA).

With the velocities v, the mass matrix M, the bias force nle, the generalised force F, the constraints G and the step
dt, the stages k_1, k_2 and k_3 of a step are the solutions of

    (M' - gamma dt D) k_1 = dt (F - nle) + G^T lambda_1,    (M' - gamma dt D) k_(i+1) = M' k_i + G^T lambda_(i+1),
    G k_i = -G v,    M' = M - dt D_implicit,    gamma = 1 - 1/sqrt(2).

D is the derivative by the speeds of the forces of soil and motors, and D_implicit the derivative of the forces that are
taken fully implicitly: servos, end stops and body effects (`step.py`). k_1 and k_2 make up the step; k_3 only shows
whether a speed grows from stage to stage.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008), sections 6.2 (CRBA) and 8.2 (constraints).
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.simulation.native.shared import GAMMA

COUNT = 3
"""Number of stages for which the equations are solved. Two stages make up the step, and a third one shows whether a
speed grows from stage to stage (`pace.growth`)."""


class Slopes(NamedTuple):
    """Derivatives by the speeds of the forces in a step. Motors, servos and end stops act on single joints, so that
    only the diagonals of their derivatives are stored.
    """

    soil: np.ndarray
    "(nv, nv) derivative of the soil's generalised force"
    motor: np.ndarray
    "(nv,) diagonal of the derivative of the motors' torques"
    spring: np.ndarray
    "(nv,) diagonal of the derivative of the torques of servos and end stops, which are taken fully implicitly"
    push: np.ndarray
    "(nv, nv) derivative of the generalised force of the body effects, which are taken fully implicitly"


class StageEquations(NamedTuple):
    """The equations of a step for its stages. The docstring of the module contains them."""

    model: pin.Model
    "Pinocchio's model of the rover, with the inertia of the motors' rotors"
    data: pin.Data
    "Pinocchio's work space for this model"
    q: np.ndarray
    "(nq,) configuration in the middle of the step"
    v: np.ndarray
    "(nv,) velocity at the beginning of the step"
    dt: float
    "length of the step [s]"
    G: np.ndarray
    "(constraints, nv) constraint matrix (`constraint_rows`)"
    force: np.ndarray
    "(nv,) generalised force F without the bias force"
    slopes: Slopes


class Stages(NamedTuple):
    """Solution of the equations of a step for its stages."""

    changes: np.ndarray
    """(COUNT, nv) changes of the speeds v in the stages of the step, called k_1, k_2 and k_3"""
    impulses: np.ndarray
    "(COUNT, constraints) multipliers lambda of the constraints: impulses [N s, N m s]"


def composite_stages(equations: StageEquations) -> Stages:
    """Return the stages of a step, solved with Pinocchio's mass matrix (`pin.crba`) and bias force
    (`pin.nonLinearEffects`).

    The constraints are added as rows with multipliers. One linear system with the matrix (M' - gamma dt D, G^T; G, 0)
    then gives the speeds and the impulses of each stage.
    """
    model, data, q, v, dt, G, force, slopes = equations
    upper = np.triu(pin.crba(model, data, q))  # Pinocchio fills the upper triangle only
    mass = upper + np.triu(upper, 1).T - dt * (np.diag(slopes.spring) + slopes.push)
    nle = pin.nonLinearEffects(model, data, q, v)
    effective_mass = mass - GAMMA * dt * (slopes.soil + np.diag(slopes.motor))
    saddle = np.block([[effective_mass, G.T], [G, np.zeros((len(G), len(G)))]])
    changes, impulses = np.zeros((COUNT, len(v))), np.zeros((COUNT, len(G)))
    momentum = dt * (force - nle)
    for stage in range(COUNT):
        # The unknown below the speeds is -lambda.
        solution = np.linalg.solve(saddle, np.append(momentum, -G @ v))
        changes[stage], impulses[stage] = solution[: len(v)], -solution[len(v) :]
        momentum = mass @ changes[stage]
    return Stages(changes, impulses)
