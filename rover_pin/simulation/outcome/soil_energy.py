"""Energy that the soil returns in a drive although it has not received it before. Such energy shows that a traction law
creates energy.
"""

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import joints_of, suspension_dofs
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import Angles, FixedAngles
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.wheel_forces import wheel_forces

SLIP_GRID = np.linspace(-1.0, 1.0, 81)
"""Slips at which the shear of the contact law is integrated. The integral is right to 1e-4, because the curve is
smooth."""
MIN_REPORTED_SHARE = 0.005
"""Limit for a warning about spurious energy, as a fraction of the drive's largest energy, or of weight times wheel
radius if this is larger. Less energy is not reported."""
LAG_REASON = (
    "sheared soil acts like a spring, and returns more energy than it stored if the load or the ground under a wheel "
    "changes meanwhile; effect.RelaxedSlip.length sets the distance over which the slip lags"
)
"""Reason that the warning states for energy that a traction form creates, unless REASONS has another reason for this
form."""
REASONS = {"net": "near rest, the compaction resistance of Eq (7) pushes the rover although no wheel rolls"}
"""Name of a traction form (the formula for the pull from the stresses) -> reason why this form creates energy. All
other forms get LAG_REASON."""


class ShearStore(NamedTuple):
    """Energy [J] that the sheared soil under all wheels stores like a spring, at each of the T rows of a drive.

    Both arrays are 0 if the slip follows the speeds without a lag (`AlgebraicSlip`).
    """

    taken: np.ndarray
    """(T,) energy that the soil has stored since the previous row, L sum f_n M(s) ds (`shear_store` defines the
    symbols); negative if the soil has returned energy"""
    stored: np.ndarray
    """(T,) total energy that the sheared soil has stored at each row"""

    @property
    def overdrawn(self) -> float:
        """Energy [J] that the sheared soil returned in excess of the energy that it had stored before. This happens if
        wheel loads change in the meantime.
        """
        balance = np.cumsum(self.taken)
        return max(0.0, float(np.max(np.maximum.accumulate(balance - self.stored) - balance)))


def shear_store(model: Model, trace: Trace) -> ShearStore:
    """Return the energy that the sheared soil under the wheels stores and returns over the rows of a drive.

    The slip law `RelaxedSlip` is L ds/dt = r omega - v - u s, with the slip s, its length L, the rim speed r omega, the
    travel speed v and u = max(|r omega|, |v|). A shear force f = T / r (torque T, wheel radius r) has the power f (r
    omega - v) = f u s + f L ds/dt: the first part is lost, and the second part loads a spring whose stretch is L s. The
    spring stores E = L f_n int M ds, where M = T / (r f_n) follows from the model's soil and angles, and f_n is the
    normal force; the integral begins at the slip at which M is 0. The function neglects the contributions of further
    effects to M, soils with a ground index other than 0, and sideways shear.

    Parameters
    ----------
    model, trace : Model, Trace
        The model and the trace of its drive.
    """
    slip, load = model.slip, np.maximum(trace.stack("normal"), 0.0)
    if not isinstance(slip, RelaxedSlip):
        return ShearStore(np.zeros(len(load)), np.zeros(len(load)))
    # The law's own state s follows from the recorded slip S = s + damping ds/dt, by implicit steps from row to row.
    S, damping = trace.stack("slip"), float(slip.damping)
    s = S.copy()
    for row, dt in enumerate(np.diff(trace.t), start=1):
        s[row] = (damping * s[row - 1] + dt * S[row]) / (damping + dt)
    angles = next((effect.angles for effect in model.effects if isinstance(effect, SoilTraction)), FixedAngles())
    # As plain numbers, so that the integral of an equal soil is found again.
    soil = Soil(*laws.numbers(model.soils[:1]).tolist())
    shear = [_integral_of_shear(angles, soil, mount.wheel) for mount in model.rover.wheels]
    stretched = [np.interp(of_wheel, SLIP_GRID, integral) for of_wheel, integral in zip(s.T, shear, strict=True)]
    stored = float(slip.length) * np.column_stack(stretched)
    return ShearStore(np.sum(load * np.diff(stored, axis=0, prepend=stored[:1]), axis=1), np.sum(load * stored, axis=1))


@lru_cache(maxsize=64)
def _integral_of_shear(angles: Angles, soil: Soil, wheel: Wheel) -> np.ndarray:
    """Return the integral of the torque ratio M over the slip S, int M dS, at the slips of SLIP_GRID. M = T / (r f_n),
    with the torque T, the wheel radius r and the normal force f_n.

    The integral begins at the slip at which M is 0, where the integral is smallest. The array is stored for later calls
    and must not be changed.
    """
    # The torque ratio at all slips at once, and its integral by trapezia.
    forces = wheel_forces(ca.DM(SLIP_GRID), *angles.angles(sinkage(soil.theta_1, wheel), wheel, soil), wheel, soil)
    M = np.array(forces.torque / (wheel.r * forces.f_n)).ravel()
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (M[1:] + M[:-1]) * np.diff(SLIP_GRID))])
    return integral - np.min(integral)


class SpuriousEnergy(NamedTuple):
    """Energy [J] that a rover received from the soil in a drive although the soil had not received this energy
    before.
    """

    traction: float
    """energy created by the traction law: the power that sheared soil returns to wheels and rover (`spurious_energy`),
    integrated over the drive, minus the energy that the sheared soil had stored"""
    soil: float
    """largest decrease of the energy that the soil has taken, minus the energy that had pressed the wheels into the
    soil"""
    meanwhile: float
    """work of the motors during those intervals between rows in which the traction law returned energy [J]"""


def spurious_energy(model: Model, trace: Trace, least: float = 0.0) -> SpuriousEnergy:
    """Return the energy that the soil created over the rows of a drive.

    Sheared soil takes the power T omega - f_t v from a wheel, where T is the wheel's torque, omega its rate in the
    world, f_t its tangential force without the part of `MotionResistance`, and v its travel speed. If this power is
    negative, the soil drives both the wheel and the rover. At a steady slip no traction law does this
    (`soil.wheel_forces.paid_for`). If the slip lags behind the speeds and falls, the soil returns energy that it had
    stored (`shear_store`), which is not spurious.

    Parameters
    ----------
    model, trace : Model, Trace
        The model and the trace of its drive, which must have at least two rows.
    least : float
        Limit [J]. If the soil returned less energy than this by traction, the energy created by traction counts as
        zero, and the stored energy is not computed.
    """
    # Power that the soil takes from each wheel, without the motion resistance; below 0 the soil gives.
    dt = np.diff(trace.t, prepend=trace.t[:1])
    torque, pull, load, v = map(trace.stack, ("torque", "tangential", "normal", "travel"))
    rate = trace.stack("wheel_rate") + carrier_rates(model, trace)
    rim = rate * model.built.radii
    for effect in model.effects:
        if isinstance(effect, MotionResistance):
            pull = pull + float(effect.R) * load * v / np.hypot(v, effect.fading(rim))
    taken = np.sum(torque * rate - pull * v, axis=1) * dt
    # Sheared soil may give back what it had stored, and nothing more.
    gave = np.maximum(-taken, 0.0)
    traction = 0.0
    if np.sum(gave) > least:
        store = shear_store(model, trace)
        unstored = np.sum(np.maximum(gave + np.minimum(store.taken, 0.0), 0.0))
        traction = float(min(np.sum(gave), unstored + store.overdrawn))

    # The soil's account may fall by the energy with which wheels were pressed in, int f_n dh ~ f_n h / (n + 3/2).
    power = np.gradient(trace["energy_motor"], trace.t)
    pressed = np.sum(load * trace.stack("sinkage"), axis=1) / (float(model.soils[0].n) + 1.5)
    # A rover that was set down has pressed its wheels in before the first row, by no more than later.
    start = [-float(np.max(pressed))] if "set_down" in trace.attrs else []
    lost = np.array([*start, *(trace["energy_soil"] - pressed)])
    fall = float(np.max(np.maximum.accumulate(lost) - lost))
    return SpuriousEnergy(traction, fall, float(power[taken < 0.0] @ dt[taken < 0.0]))


def energy_warning(model: Model, trace: Trace) -> str:
    """Return a warning about energy that the soil created in a drive, or an empty string if it created less than
    MIN_REPORTED_SHARE of the drive's energy.

    Two cases are distinguished. Energy that traction creates is caused by the traction law, at every step size. A
    decrease of the energy that the soil has taken may also be caused by a step that is too long.
    """
    if len(trace.t) < 2:
        return ""
    # The limit is a fraction of the largest energy of the drive.
    terms = [np.ptp(values) for name, values in trace.channels.items() if name.startswith("energy_")]
    weight = float(np.mean(np.sum(trace.stack("normal"), axis=1)))
    least = MIN_REPORTED_SHARE * max(float(max(terms)), weight * float(np.mean(trace.attrs["wheel_radii_m"])))
    extra, sentences = spurious_energy(model, trace, least), []
    # A share above the motors' own work would not be informative.
    if extra.traction > least:
        form, share = trace.attrs.get("traction_form", ""), ""
        if extra.meanwhile > extra.traction:
            share = f", {100.0 * extra.traction / extra.meanwhile:.2g} % of the motors' work meanwhile"
        sentences.append(
            f"the traction form {form} created {extra.traction:.2g} J of energy{share}: {REASONS.get(form, LAG_REASON)}"
        )
    if extra.soil > least:
        sentences.append(
            f"the soil returned energy that it had not received: its energy account fell by {extra.soil:.2g} J more "
            "than the wheels had pressed into it, as loads and sinkages show"
        )
    return "; ".join(sentences)


def carrier_rates(model: Model, trace: Trace) -> np.ndarray:
    """Return the pitch rate of the link that carries each wheel (rows, wheels) [rad/s]. It is the pitch rate of the
    base plus the rates of the suspension joints between base and wheel.
    """
    rover = model.built
    data = rover.model.createData()
    pin.computeJointJacobians(rover.model, data, pin.neutral(rover.model))
    joints = zip(suspension_dofs(rover), joints_of(rover).names, strict=True)
    rates = {dof: np.gradient(trace[name], trace.t) for dof, name in joints}
    base = np.gradient(trace["body_pitch"], trace.t)
    pitch_rates = []
    for mount in rover.wheels:
        # Row 4 of the Jacobian is the rotation about y, at the neutral configuration.
        J = pin.getJointJacobian(rover.model, data, mount.joint, pin.LOCAL_WORLD_ALIGNED)
        pitch_rates.append(base + sum(J[4, dof] * rate for dof, rate in rates.items()))
    return np.array(pitch_rates).T
