"""The longest time step that the ground under a rover allows. The step has to resolve the fastest vibration of the
rover on the soil under its wheels.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import SimulationError
from rover_pin.contact import Soil, Wheel
from rover_pin.rover.forward_dynamics import constraint_rows, wheel_jacobians
from rover_pin.rover.rover import Rover
from rover_pin.simulation.compiled.drive_fields import model_with_armature
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.state import DriveState
from rover_pin.soil.sinkage import power_law_guess, sinkage
from rover_pin.soil.stress import modulus

MAX_PHASE = 1.2
"""Largest phase omega dt [rad] of the fastest vibration in one step; a step with a larger phase is divided. The method
is stable up to a phase of 2; at 1.2, the frequency of the computed vibration is right to 6 %. The rest of the margin
allows for wheel loads above an equal share of the weight: omega grows as load^(1/6) for n = 1 and as load^(1/3) for n =
3, with the sinkage exponent n of the soil."""
PRESSED_SHARE, MAX_FIRMNESS = 1e-3, 100.0
"""PRESSED_SHARE: depth that `firmness` presses the rover into the soil, as a fraction of the smallest sinkage.
MAX_FIRMNESS: largest factor that `firmness` returns."""
MAX_PARTS = 400
"""Largest number of parts into which a step may be divided because of stiff ground. If more parts are needed, the drive
is refused."""
NORMAL, SINKAGE = RECORD.index("normal"), RECORD.index("sinkage")
"""Indices of the columns of normal force and sinkage in a stepper's array `record`."""


def parts(model: Model, state: DriveState, dt: float, firmer: float = 1.0) -> int:
    """Return the smallest number of equal parts into which a step `dt` [s] must be divided to be stable and accurate on
    the ground: omega dt / parts <= MAX_PHASE.

    The step computes the normal forces f_n(h) of the contacts, which are springs over the sinkage h, from the state at
    its beginning (explicitly). It is therefore stable only for omega dt < 2 (Stoermer-Verlet), where omega [rad/s] is
    the rover's fastest vibration on these springs:

        omega^2 = largest eigenvalue of K^1/2 U (M^-1)_G U^T K^1/2,   K_ii = df_n/dh = (n + 1/2) W / h(W).

    K is the diagonal matrix of the wheels' stiffnesses, U are the wheels' upward Jacobians, (M^-1)_G is the inverse
    mass matrix with the differential's constraint, n the sinkage exponent of the soil, W an equal share of the weight,
    and h(W) the sinkage under it in the firmest of the terrain's soils. Damping is taken implicitly and does not limit
    the step.

    Parameters
    ----------
    model, state : Model, DriveState
        The rover in its configuration.
    dt : float
        The step that the caller asks for [s].
    firmer : float
        Stiffness of the soils with all effects, divided by their stiffness without effects (`firmness`).

    Raises
    ------
    SimulationError
        The soil is so firm that the step would need more than MAX_PARTS parts.
    """
    # Frequencies grow with the square root of the stiffness.
    omega = math.sqrt(firmer) * contact_frequency(model, state)
    needed = max(1, math.ceil(omega * dt / MAX_PHASE - 1e-9))
    if needed > MAX_PARTS:
        raise SimulationError(
            f"The ground is too stiff for dt = {dt:g} s: the rover vibrates on it at {omega:.3g} rad/s, so that each "
            f"step must be divided into {needed} parts, but at most {MAX_PARTS} are allowed. Lower soil.k_1, raise "
            f"soil.n to 0.5 or more, or give a dt of at most {MAX_PARTS * MAX_PHASE / omega:.2g} s."
        )
    return needed


def firmness(stepper: Any, model: Model) -> float:
    """Return the ratio of the stiffness of a model's wheel contacts, with all effects, to the stiffness of the soil
    alone (`stiffness`). It is limited to the range from 1 to MAX_FIRMNESS.

    The factor is measured: the rover is pressed into the soil by a small distance, and the change of the loads is
    compared with the stiffness of the soil without effects. Effects that depend on the distance driven, or that act
    elsewhere on the terrain, are not detected.

    Parameters
    ----------
    stepper : Stepper
        The object that takes the steps, with a state at rest and a step so short that nothing moves. It is restored
        afterwards.
    model : Model
        The model of the drive.
    """
    # Loads and sinkages before and after the base is lowered.
    state, record, before = stepper.state, stepper.record, stepper.saved_arrays()
    stepper.step()
    load, h = record[:, NORMAL].copy(), record[:, SINKAGE].copy()
    touching = (load > 0.0) & (h > 0.0)
    if touching.any():
        state.q[2] -= PRESSED_SHARE * float(h[touching].min())
    stepper.step()
    # Only wheels that touch, and that really sank deeper, show a stiffness.
    soil = model.soils[int(model.ground.ground_at(float(state.q[0]), float(state.q[1])))]
    ratios = [
        (record[i, NORMAL] - load[i]) / (record[i, SINKAGE] - h[i]) / stiffness(float(load[i]), mount.wheel, soil)
        for i, mount in enumerate(model.rover.wheels)
        if touching[i] and record[i, SINKAGE] > h[i] and float(modulus(mount.wheel, soil)) > 0.0
    ]
    stepper.restore(before)
    return min(MAX_FIRMNESS, max([1.0, *ratios]))


def contact_frequency(model: Model, state: DriveState) -> float:
    """Return the frequency omega [rad/s] of the rover's fastest vibration on the springs of its contacts, in the
    configuration of `state`. The docstring of `parts` gives the eigenvalue problem.
    """
    rover, motor, share = model.built, model.motor, model.wheel_share
    mobility = _mobility(rover, float(motor.armature), model.rigid_differential, state.q.tobytes())
    # Every wheel may reach the firmest soil of the terrain, so that one step serves the whole drive.
    soils = [model.soils[index] for index in sorted(model.ground.ground_indices)]
    firmest = {wheel: max(stiffness(share, wheel, soil) for soil in soils) for wheel in {w.wheel for w in rover.wheels}}
    root = np.sqrt([firmest[mount.wheel] for mount in rover.wheels])
    return math.sqrt(float(np.linalg.eigvalsh(root[:, None] * mobility * root)[-1]))


@lru_cache(maxsize=64)
def _mobility(rover: Rover, armature: float, rigid_differential: bool, configuration: bytes) -> np.ndarray:
    """Return the vertical mobility of a rover at its wheels, the matrix U (M^-1)_G U^T (wheels, wheels) [1/kg] of the
    eigenvalue problem in `parts`. Its entry (i, j) is the upward acceleration of wheel i for a unit upward force on
    wheel j.

    The array is stored for later calls and must not be changed. `configuration` is the array q as bytes, which can be a
    key of the cache.
    """
    q = np.frombuffer(configuration)
    pin_model = model_with_armature(rover, armature)
    M = np.array(pin.crba(pin_model, pin_model.createData(), q))
    inverse = np.linalg.inv(np.triu(M) + np.triu(M, 1).T)
    # A constraint G v = 0 removes the motions that would violate it from the inverse mass.
    G = constraint_rows(rover, differential=rigid_differential)
    if len(G):
        inverse -= inverse @ G.T @ np.linalg.solve(G @ inverse @ G.T, G @ inverse)
    U = np.array([J[2] for J in wheel_jacobians(rover, q)])
    return np.asarray(U @ inverse @ U.T)


def stiffness(load: float, wheel: Wheel, soil: Soil) -> float:
    """Return the stiffness df_n/dh [N/m] of the soil under a wheel that carries `load` [N], where f_n is the normal
    force and h the sinkage.

    By Eqs (4) and (6) of the paper (stress and normal force), f_n ~ h^(n + 1/2) at small angles, with the sinkage
    exponent n, so that df_n/dh = (n + 1/2) f_n / h.
    """
    if not float(modulus(wheel, soil)) > 0.0:
        return 0.0
    h = sinkage(math.exp(power_law_guess(math.log(load), wheel, soil)), wheel)
    return (float(soil.n) + 0.5) * load / float(h)
