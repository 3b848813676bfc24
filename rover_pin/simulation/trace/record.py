"""From the rows of a drive to its trace: channels named as in a drive log, and the truth beside them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled.body_law import elastic_energy
from rover_pin.simulation.compiled.suspension import joints_of, suspension_places
from rover_pin.simulation.model.cruise import level_slip, traction_factor
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import ENERGY, RECORD
from rover_pin.simulation.trace.trace import Trace
from rover_pin.version import __version__

WHEEL_CHANNELS = {
    "slip": ("slip", "-"),
    "sinkage": ("sinkage", "m"),
    "normal": ("normal", "N"),
    "tangential": ("tangential", "N"),
    "lateral": ("lateral", "N"),
    "torque": ("torque", "N m"),
    "travel": ("travel", "m/s"),
}
"""Truth-only channels: name -> (column of the record, unit)."""


def trace_of(model: Model, rows: np.ndarray, attrs: Mapping[str, Any]) -> Trace:
    """Return the trace of sampled rows (`row_type`); empty where the drive failed before the first."""
    if not len(rows):
        return Trace({"t_s": np.zeros(0)}, {"t_s": "s"}, {**model_attrs(model), **attrs})
    channels: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}

    def put(name: str, unit: str, values: np.ndarray) -> None:
        channels[name], units[name] = values.copy(), unit

    put("t_s", "s", rows["t"])
    q, v, record, duty, energy = (rows[name] for name in ("q", "v", "record", "duty", "energy"))
    for i, wheel in enumerate(model.rover.wheels):
        put(f"duty_{wheel.name}", "-", duty[:, i])
        put(f"wheel_rate_{wheel.name}", "rad/s", v[:, wheel.dof])
        put(f"current_{wheel.name}_A", "A", record[:, i, RECORD.index("current")])
        for channel, (column, unit) in WHEEL_CHANNELS.items():
            put(f"{channel}_{wheel.name}", unit, record[:, i, RECORD.index(column)])
    for name, index in model.rover.angles.items():
        put(name, "rad", q[:, index])
    for i, axis in enumerate("xyz"):
        put(f"body_{axis}", "m", q[:, i])
    for i, name in enumerate(("roll", "pitch", "yaw")):
        angle = rows["attitude"][:, i]
        put(f"body_{name}", "rad", angle if name != "yaw" else np.unwrap(angle))
    for i, axis in enumerate("xyz"):
        put(f"body_v{axis}", "m/s", rows["velocity"][:, i])
    put("battery_V", "V", record[:, 0, RECORD.index("supply")])
    for i, name in enumerate(ENERGY if model.body_effects else ENERGY[:-1]):
        put(f"energy_{name}", "J", energy[:, i])
    if model.rover.differential is not None:
        put("differential_torque", "N m", rows["differential"])
    put("energy_kinetic", "J", rows["mechanical"][:, 0])
    put("energy_potential", "J", rows["mechanical"][:, 1])
    if model.body_effects:
        put("energy_elastic", "J", _elastic(model, q))
    return Trace(channels, units, {**model_attrs(model), **attrs})


def _elastic(model: Model, q: np.ndarray) -> np.ndarray:
    """Return the part of `energy_body` that springs hold at each configuration (rows)."""
    energy = elastic_energy(model.body_effects, joints_of(model.rover))
    return np.array(energy.map(len(q))(q[:, :7].T, q[:, suspension_places(model.rover)].T)).ravel()


def model_attrs(model: Model) -> dict[str, Any]:
    """Return what a trace says of its model: names of rover, traction form and effects, R, gravity, versions."""
    forms = [effect.form.name for effect in model.effects if hasattr(effect, "form")]
    resistances = [float(effect.R) for effect in model.effects if isinstance(effect, MotionResistance)]
    return {
        "rover": model.rover.name,
        "wheels": [wheel.name for wheel in model.rover.wheels],
        "wheel_radii_m": [float(wheel.wheel.r) for wheel in model.rover.wheels],
        "traction_form": forms[0] if forms else "none",
        "motion_resistance_R": sum(resistances),
        "notes": notes(model),
        "slip_law": type(model.slip).__name__,
        "effects": [type(effect).__name__ for effect in (*model.effects, *model.motor_effects, *model.body_effects)],
        "gravity_mps2": model.gravity,
        "buried": model.buried,
        "made_by": "rover_pin " + __version__,
    }


def notes(model: Model) -> list[str]:
    """Return what a reader should know of a model: driven wheels skid on the flat, sinking or rising costs nothing."""
    return [note for note in (_skids(model), *_unpaid_notes(model), *_lift_notes(model)) if note]


def _skids(model: Model) -> str:
    tractions = [effect for effect in model.effects if isinstance(effect, SoilTraction)]
    if not tractions:
        return ""
    R = sum(float(effect.R) for effect in model.effects if isinstance(effect, MotionResistance))
    level = model.soils[0], model.rover, tractions[0], model.gravity
    slip = level_slip(R, *level)
    if not slip:
        return ""
    return (
        f"R = {R:.3g} is less than the {traction_factor(0.0, *level):.3g} that shearing this soil takes at no slip: "
        f"driven wheels skid at S = {slip:.2g} on level ground; leave R out, or give more."
    )


def _unpaid_notes(model: Model) -> list[str]:
    tractions = [effect for effect in model.effects if isinstance(effect, SoilTraction)]
    unpaid = [type(effect).__name__ for effect in model.effects if effect.unpaid]
    if not unpaid or not any(traction.leaves_compaction_out for traction in tractions):
        return []
    who, form = f"{', '.join(unpaid)} change{'s' * (len(unpaid) == 1)}", tractions[0].form.name
    return [
        f"{who} how deep wheels stand, and the {form} form lets that cost or save nothing: R stays; form=net with "
        "angles=sinkage pays for it."
    ]


def _lift_notes(model: Model) -> list[str]:
    lifted = [
        (type(effect).__name__, PAYING[type(effect)].__name__) for effect in model.effects if type(effect) in PAYING
    ]
    return [
        f"{name} lifts a wheel whose slip falls as a spring would, by what it sank: sand gives nothing back; {paying} "
        "pays for the lift."
        for name, paying in lifted
    ]


PAYING: dict[type, type] = {SlipSinkage: SlipSoftening, SkidSinkage: Ploughing}
"""Laws of the slip of now, and those of the same thing that pay for the way up."""
