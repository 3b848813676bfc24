"""What a soil gives that it has not: traction laws that create energy, found in the energy balance of a drive."""

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
from rover_pin.simulation.compiled.suspension import joints_of, suspension_dofs
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import Angles, FixedAngles
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.wheel_forces import wheel_forces

GRID = np.linspace(-1.0, 1.0, 81)
"""Slips at which the law's shear is taken; its integral is that of a smooth curve to 1e-4."""


class ShearStore(NamedTuple):
    """The account of that spring, all wheels together, at each row of a drive [J]; 0 where slip follows at once."""

    taken: np.ndarray
    "what it took since the row before, L sum f_n M(s) ds; negative while it gives back"
    stored: np.ndarray
    "what it holds, E"

    @property
    def overdrawn(self) -> float:
        """By how much it gave back more than it had held and took [J]: loads that change make it, at most."""
        balance = np.cumsum(self.taken)
        return max(0.0, float(np.max(np.maximum.accumulate(balance - self.stored) - balance)))


def shear_store(model: Model, trace: Trace) -> ShearStore:
    """Return what the shear under the wheels takes, holds and gives back over the rows of a drive.

    `RelaxedSlip` is L ds/dt = r omega - v - u s, u = max(|r omega|, |v|): of the power of a shear force f = T / r,
    f (r omega - v) = f u s + f L ds/dt, the first is lost and the second loads a spring whose stretch is L s. It holds
    E = L f_n int M ds, M = T / (r f_n) of the model's soil and angles, from the slip at which M is 0. Left out is what
    further effects add to M, soils of another ground index than 0, and the shear sideways.
    """
    slip, load = model.slip, np.maximum(trace.stack("normal"), 0.0)
    if not isinstance(slip, RelaxedSlip):
        return ShearStore(np.zeros(len(load)), np.zeros(len(load)))
    lagging = _lagging(trace.t, trace.stack("slip"), float(slip.damping))
    angles = next((effect.angles for effect in model.effects if isinstance(effect, SoilTraction)), FixedAngles())
    # As plain numbers, whatever they came as: so the soil is found again.
    soil = Soil(*laws.numbers(model.soils[:1]).tolist())
    shear = [_integral_of_shear(angles, soil, mount.wheel) for mount in model.rover.wheels]
    stretched = [np.interp(s, GRID, integral) for s, integral in zip(lagging.T, shear, strict=True)]
    stored = float(slip.length) * np.column_stack(stretched)
    return ShearStore(np.sum(load * np.diff(stored, axis=0, prepend=stored[:1]), axis=1), np.sum(load * stored, axis=1))


def _lagging(t: np.ndarray, S: np.ndarray, damping: float) -> np.ndarray:
    """Return the state s of S = s + T ds/dt, by implicit steps from row to row; it begins at S."""
    s = S.copy()
    for row, dt in enumerate(np.diff(t), start=1):
        s[row] = (damping * s[row - 1] + dt * S[row]) / (damping + dt)
    return s


@lru_cache(maxsize=64)
def _integral_of_shear(angles: Angles, soil: Soil, wheel: Wheel) -> np.ndarray:
    """Return int M ds at the slips of GRID, from where M is 0: 0 where it is least; not to be written to."""
    forces = wheel_forces(ca.DM(GRID), *angles.angles(sinkage(soil.theta_1, wheel), wheel, soil), wheel, soil)
    M = np.array(forces.torque / (wheel.r * forces.f_n)).ravel()
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (M[1:] + M[:-1]) * np.diff(GRID))])
    return integral - np.min(integral)


WORTH_TELLING = 0.005
"""Share of the drive's greatest energy, or of weight times wheel radius, from which spurious energy is reported."""

LAGS = (
    "slip that lags keeps its shear while a wheel's load or ground changes, and gives back more than it stored; "
    "effect.RelaxedSlip.length says how far it lags"
)
WHY = {"net": "near rest Eq (7)'s compaction pushes, though nothing rolls"}
"""Why a form gives energy, where it is not that its slip `LAGS`."""


class SpuriousEnergy(NamedTuple):
    """Energy [J] that a drive had from nowhere."""

    traction: float
    "integral of max(-sum (T omega - (f_t + R f_n s) v), 0) over the drive, less what sheared soil had stored of it"
    soil: float
    "by how much the soil's account fell in all, less what pressed wheels in"
    meanwhile: float
    "what the motors gave while traction did [J]"


def spurious_energy(model: Model, trace: Trace, least: float = 0.0) -> SpuriousEnergy:
    """Return what the soil gave from nowhere over the rows of a drive, two at least; up to `least` [J] in all is 0.

    Sheared soil takes T omega - f_t v from a wheel, omega of the world and not of the link that carries it, without
    what `MotionResistance` takes of f_t: below 0 it drives the wheel and the rover at once. At a steady slip no law
    does (`soil.wheel_forces.paid_for`); a lagging slip that falls gives back what sheared soil stored (`shear_store`).
    """
    dt = np.diff(trace.t, prepend=trace.t[:1])
    torque, pull, load, v = map(trace.stack, ("torque", "tangential", "normal", "travel"))
    rate = trace.stack("wheel_rate") + carriers(model, trace)
    rim = rate * model.built.radii
    for effect in model.effects:
        if isinstance(effect, MotionResistance):
            pull = pull + float(effect.R) * load * v / np.hypot(v, effect.fading(rim))
    taken = np.sum(torque * rate - pull * v, axis=1) * dt
    power = np.gradient(trace["energy_motor"], trace.t)
    pressed = np.sum(load * trace.stack("sinkage"), axis=1) / (float(model.soils[0].n) + 1.5)
    # Before the first row a rover that was set down has had nothing, and its wheels held no more than they do later.
    start = [-float(np.max(pressed))] if "set_down" in trace.attrs else []
    lost = np.array([*start, *(trace["energy_soil"] - pressed)])
    fall = float(np.max(np.maximum.accumulate(lost) - lost))
    gave = np.maximum(-taken, 0.0)
    unstored = _unstored_energy(model, trace, gave) if np.sum(gave) > least else 0.0
    return SpuriousEnergy(unstored, fall, float(power[taken < 0.0] @ dt[taken < 0.0]))


def _unstored_energy(model: Model, trace: Trace, gave: np.ndarray) -> float:
    """Return what of what traction gave from row to row [J] sheared soil had not stored before."""
    store = shear_store(model, trace)
    unstored = np.sum(np.maximum(gave + np.minimum(store.taken, 0.0), 0.0))
    return float(min(np.sum(gave), unstored + store.overdrawn))


def energy_warning(model: Model, trace: Trace) -> str:
    """Return what is to be said of a drive's energy from nowhere: nothing below half a per cent of its energy.

    What traction alone gave is its law's, at any step; the soil's account may fall by a coarse step. (Of 1,000 random
    drives of an earlier form of this account traction alone gave in 49, of which none moved at half the step.)
    """
    if len(trace.t) < 2:
        return ""
    least = WORTH_TELLING * _scale(trace)
    extra = spurious_energy(model, trace, least)
    return "; ".join(
        sentence for sentence in (_of_traction(trace, extra, least), _of_account(extra, least)) if sentence
    )


def _of_traction(trace: Trace, extra: SpuriousEnergy, least: float) -> str:
    if extra.traction <= least:
        return ""
    form, works = trace.attrs.get("traction_form", ""), extra.meanwhile > extra.traction
    share = f", {100.0 * extra.traction / extra.meanwhile:.2g} % of the motors' work meanwhile" if works else ""
    return f"the {form} form's traction gave {extra.traction:.2g} J from nowhere{share}: {WHY.get(form, LAGS)}"


def _of_account(extra: SpuriousEnergy, least: float) -> str:
    if extra.soil <= least:
        return ""
    return f"the soil's account fell by {extra.soil:.2g} J more than loads and sinkages of the rows had pressed into it"


def carriers(model: Model, trace: Trace) -> np.ndarray:
    """Return how fast the links that carry the wheels pitch [rows, wheels] [rad/s]: of the base, and of the joints."""
    rover = model.built
    data = rover.model.createData()
    pin.computeJointJacobians(rover.model, data, pin.neutral(rover.model))
    joints = zip(suspension_dofs(rover), joints_of(rover).names, strict=True)
    rates = {dof: np.gradient(trace[name], trace.t) for dof, name in joints}
    base = np.gradient(trace["body_pitch"], trace.t)
    pitch_rates = []
    for mount in rover.wheels:
        J = pin.getJointJacobian(rover.model, data, mount.joint, pin.LOCAL_WORLD_ALIGNED)
        pitch_rates.append(base + sum(J[4, dof] * rate for dof, rate in rates.items()))
    return np.array(pitch_rates).T


def _scale(trace: Trace) -> float:
    terms = [np.ptp(values) for name, values in trace.channels.items() if name.startswith("energy_")]
    weight = float(np.mean(np.sum(trace.stack("normal"), axis=1)))
    return max(float(max(terms)), weight * float(np.mean(trace.attrs["wheel_radii_m"])))
