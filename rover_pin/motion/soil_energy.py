"""What a soil gives that it has not: traction laws that create energy, told from the account of a drive."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.motion.model import Model
from rover_pin.motion.trace import Trace

WORTH_TELLING = 0.005
"""Share of the drive's greatest energy, or of the weight times a wheel's radius, from which a gift is told."""

AT_SKID = (
    "at S < 0 it drives wheel and rover at once; a greater R, as of cruise_slip, keeps level driving from there, "
    "form=net pays for it"
)
WHY = {"net": "near rest Eq (7)'s compaction pushes, though nothing rolls"}
"""Why a form gives energy, where it is not `AT_SKID`."""


class Gift(NamedTuple):
    """Energy [J] that a drive had from nowhere."""

    traction: float
    "what traction gave more than it took, while it did: integral of max(-sum (T omega - (f_t + R f_n s) v), 0)"
    soil: float
    "by how much the soil's account fell in all, less what pressed wheels in"
    meanwhile: float
    "what the motors gave while traction did [J]"


def gift(model: Model, trace: Trace) -> Gift:
    """Return what the soil gave from nowhere over the rows of a drive, two at least.

    Sheared soil takes T omega - f_t v from a wheel, without what `MotionResistance` takes of f_t: below 0 it drives the
    wheel and the rover at once. The net form's compaction is part of its law, and makes it passive.
    """
    dt = np.diff(trace.t, prepend=trace.t[:1])
    torque, rate, pull, load, v = map(trace.stack, ("torque", "wheel_rate", "tangential", "normal", "travel"))
    for effect in model.effects:
        if isinstance(effect, MotionResistance):
            pull = pull + float(effect.R) * load * v / np.hypot(v, float(effect.v_0))
    taken = np.sum(torque * rate - pull * v, axis=1)
    power = np.gradient(trace["energy_motor"], trace.t)
    held = np.sum(load * trace.stack("sinkage"), axis=1) / (float(model.soils[0].n) + 1.5)
    # Before the first row a rover that was set down has had nothing, and its wheels held no more than they do later.
    start = [-float(np.max(held))] if "set_down" in trace.attrs else []
    lost = np.array([*start, *(trace["energy_soil"] - held)])
    fall = float(np.max(np.maximum.accumulate(lost) - lost))
    return Gift(float(-np.minimum(taken, 0.0) @ dt), fall, float(power[taken < 0.0] @ dt[taken < 0.0]))


def energy_warning(model: Model, trace: Trace) -> str:
    """Return a sentence where a drive had more than half a per cent of its energy from nowhere, else nothing."""
    if len(trace.t) < 2:
        return ""
    given = gift(model, trace)
    least = WORTH_TELLING * _scale(trace)
    if max(given.traction, given.soil) <= least:
        return ""
    form, works = trace.attrs.get("traction_form", ""), given.meanwhile > given.traction
    share = f", {100.0 * given.traction / given.meanwhile:.2g} % of the motors' work meanwhile" if works else ""
    fall = f"; the soil's whole account fell by {given.soil:.2g} J" if given.soil > least else ""
    return f"the {form} form's traction gave {given.traction:.2g} J from nowhere{share}{fall}: {WHY.get(form, AT_SKID)}"


def _scale(trace: Trace) -> float:
    terms = [np.ptp(values) for name, values in trace.channels.items() if name.startswith("energy_")]
    weight = float(np.mean(np.sum(trace.stack("normal"), axis=1)))
    return max(float(max(terms)), weight * float(np.mean(trace.attrs["wheel_radii_m"])))
