"""How fine a step the ground under a rover asks for: its fastest vibration on the springs of its contacts."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import SimulationError
from rover_pin.contact import Soil, Wheel
from rover_pin.rover.constraints import constraint_rows
from rover_pin.rover.forward_dynamics import wheel_jacobians
from rover_pin.rover.rover import Rover
from rover_pin.simulation.compiled.rover_numbers import model_with_armature
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import DriveState
from rover_pin.soil.sinkage import power_law_guess, sinkage
from rover_pin.soil.stress import modulus

RESOLVED = 1.2
"""Angle [rad] of the fastest vibration in one step: the step is stable to 2 and right to 6 % of the frequency at 1.2.
Left over is what a heavier load on a wheel makes of it: omega grows as load^(1/6) for n = 1, load^(1/3) for n = 3."""
PRESSED, FIRMEST = 1e-3, 100.0
"""Share of the least sinkage by which `firmness` presses, and the most that it returns."""
MAX_PARTS = 400
"""Parts into which a step may be divided by itself."""


def parts(model: Model, state: DriveState, dt: float, firmer: float = 1.0) -> int:
    """Return into how many equal parts a step `dt` [s] is divided: the least with omega dt / parts <= RESOLVED.

    The step takes the springs of the contacts, f_n(h), explicitly: it is stable for omega dt < 2 only
    (Stoermer-Verlet), omega [rad/s] the rover's fastest vibration on them,

        omega^2 = greatest eigenvalue of K^1/2 U (M^-1)_G U^T K^1/2,   K_ii = df_n/dh = (n + 1/2) W / h(W),

    U the wheels' upward Jacobians, (M^-1)_G the inverse mass with the differential's constraint, W an equal share of
    the weight and h(W) the sinkage of the firmest of the terrain's soils under it. Damping is implicit and asks for
    nothing. `firmer` is by how much the effects make the soils stiffer than their own constants do (`firmness`).

    Raises
    ------
    SimulationError
        Soil so firm that it would take more than MAX_PARTS parts.
    """
    omega = math.sqrt(firmer) * contact_frequency(model, state)
    needed = max(1, math.ceil(omega * dt / RESOLVED - 1e-9))
    if needed > MAX_PARTS:
        raise SimulationError(
            f"The ground is too stiff for dt = {dt:g} s: the rover vibrates on it at {omega:.3g} rad/s, which takes "
            f"{needed} parts of a step, and {MAX_PARTS} are allowed: lower soil.k_1 or raise soil.n to 0.5 or more, or "
            f"give a dt of at most {MAX_PARTS * RESOLVED / omega:.2g} s."
        )
    return needed


def firmness(stepper: Any, model: Model) -> float:
    """Return how much stiffer the wheels stand than `stiffness` says, 1 at least: by pressing them in a little.

    `stepper` holds a state at rest and a step so short that nothing moves; it is left as it was. What depends on the
    way, or lies elsewhere, is not seen.
    """
    state, record, before = stepper.state, stepper.record, stepper.saved_arrays()
    stepper.step()
    load, h = record[:, 3].copy(), record[:, 2].copy()
    touching = (load > 0.0) & (h > 0.0)
    if touching.any():
        state.q[2] -= PRESSED * float(h[touching].min())
    stepper.step()
    soil = model.soils[int(model.ground.ground_at(float(state.q[0]), float(state.q[1])))]
    ratios = [
        (record[i, 3] - load[i]) / (record[i, 2] - h[i]) / stiffness(float(load[i]), mount.wheel, soil)
        for i, mount in enumerate(model.rover.wheels)
        if touching[i] and record[i, 2] > h[i] and float(modulus(mount.wheel, soil)) > 0.0
    ]
    stepper.restore(before)
    return min(FIRMEST, max([1.0, *ratios]))


def contact_frequency(model: Model, state: DriveState) -> float:
    """Return omega [rad/s] of `parts` for a rover in the configuration of `state`."""
    rover, motor, share = model.built, model.motor, model.wheel_share
    mobility = _mobility(rover, float(motor.armature), model.rigid_differential, state.q.tobytes())
    soils = [model.soils[index] for index in sorted(model.ground.ground_indices)]
    firmest = {wheel: max(stiffness(share, wheel, soil) for soil in soils) for wheel in {w.wheel for w in rover.wheels}}
    root = np.sqrt([firmest[mount.wheel] for mount in rover.wheels])
    return math.sqrt(float(np.linalg.eigvalsh(root[:, None] * mobility * root)[-1]))


@lru_cache(maxsize=64)
def _mobility(rover: Rover, armature: float, rigid_differential: bool, configuration: bytes) -> np.ndarray:
    """Return U (M^-1)_G U^T of `parts` [1/kg] (wheels, wheels) at q, whose bytes these are; not to be written to."""
    q = np.frombuffer(configuration)
    pin_model = model_with_armature(rover, armature)
    M = np.array(pin.crba(pin_model, pin_model.createData(), q))
    inverse = np.linalg.inv(np.triu(M) + np.triu(M, 1).T)
    G = constraint_rows(rover, differential=rigid_differential)
    if len(G):
        inverse -= inverse @ G.T @ np.linalg.solve(G @ inverse @ G.T, G @ inverse)
    U = np.array([J[2] for J in wheel_jacobians(rover, q)])
    return np.asarray(U @ inverse @ U.T)


def stiffness(load: float, wheel: Wheel, soil: Soil) -> float:
    """Return df_n/dh [N/m] where a wheel carries `load` [N]: f_n ~ h^(n + 1/2), Eqs (4) and (6) at small angles."""
    if not float(modulus(wheel, soil)) > 0.0:
        return 0.0
    h = sinkage(math.exp(power_law_guess(math.log(load), wheel, soil)), wheel)
    return (float(soil.n) + 0.5) * load / float(h)
