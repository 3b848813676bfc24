"""The rows of a drive, as the loop writes them, and the trace that is made of these rows: channels, attributes and
notes.
"""

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
from rover_pin.simulation.model.cruise import level_slip, traction_factor
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import ENERGY, RECORD
from rover_pin.simulation.state import joints_of, suspension_places
from rover_pin.simulation.trace.trace import Trace
from rover_pin.version import __version__

WHEEL_CHANNELS = {
    "slip": "-",
    "sinkage": "m",
    "normal": "N",
    "tangential": "N",
    "lateral": "N",
    "torque": "N m",
    "travel": "m/s",
}
"""Channels of a wheel that only a simulator can record, with their units. Each channel is the column of its name in the
array `record` of a row."""
PAYING_EFFECTS: dict[type, type] = {SlipSinkage: SlipSoftening, SkidSinkage: Ploughing}
"""Pairs of effects: class of an effect that lifts a wheel without work if its slip falls -> class of the effect that
adds this work. A note names the second effect if a model has the first."""


def row_type(model: Model) -> np.dtype[Any]:
    """Return the NumPy type of the rows of a drive. A row consists of these fields, in the order of `rover_pin_row` in
    native/row.c:

    - t: time [s];
    - q, v: configuration and velocity (`DriveState`);
    - record: (wheels, quantities) quantities of the wheels at this instant, such as slip and loads; columns: `RECORD`;
    - duty, servo: (wheels,) duties and (servos,) commanded steering angles [rad];
    - energy: (terms,) energies summed since the start of the drive [J]; terms: `ENERGY`;
    - impulse: (3,) sum over time of the soil's forces on all wheels [N s];
    - differential: torque of the differential on the left rocker [N m];
    - mechanical: kinetic and potential energy [J];
    - attitude: roll, pitch (positive: nose down) and yaw of the base [rad];
    - velocity: (3,) velocity of the base in the world [m/s];
    - moved: (3,) sum of a replay's corrections of the rover's x, y [m] and heading [rad]; 0 in a drive.
    """
    # C writes a row as consecutive numbers, so that the order of these fields is the layout in native/row.c.
    rover = model.rover
    wheels = len(rover.wheels)
    steered = sum(wheel.steer_dof is not None for wheel in rover.wheels)
    shapes: dict[str, tuple[int, ...]] = {
        "t": (),
        "q": (rover.model.nq,),
        "v": (rover.model.nv,),
        "record": (wheels, len(RECORD)),
        "duty": (wheels,),
        "servo": (steered,),
        "energy": (len(ENERGY),),
        "impulse": (3,),
        "differential": (),
        "mechanical": (2,),
        "attitude": (3,),
        "velocity": (3,),
        "moved": (3,),
    }
    return np.dtype([(name, float, shape) for name, shape in shapes.items()])


def finite(rows: np.ndarray) -> np.ndarray:
    """Return the rows of a drive before the first row with a number that is not finite. Such numbers occur if the
    computation of a drive diverges.
    """
    if not len(rows):
        return rows
    bad = ~np.isfinite(np.ascontiguousarray(rows).view(float).reshape(len(rows), -1)).all(axis=1)
    return rows[: int(bad.argmax())] if bad.any() else rows


def trace_of(model: Model, rows: np.ndarray, attrs: Mapping[str, Any]) -> Trace:
    """Return the trace that is made of the rows of a drive. The trace has no rows if the drive failed before its first
    row.

    Parameters
    ----------
    model : Model
        The model of the drive.
    rows : array (`row_type`)
        The rows of the drive.
    attrs : mapping
        Attributes to add to those that describe the model (`model_attrs`).
    """
    if not len(rows):
        return Trace({"t_s": np.zeros(0)}, {"t_s": "s"}, {**model_attrs(model), **attrs})
    channels, units = channels_of(model, rows)
    channels["body_yaw"] = np.unwrap(channels["body_yaw"])
    if model.body_effects:
        channels["energy_elastic"], units["energy_elastic"] = elastic_energies(model, rows), "J"
    return Trace(channels, units, {**model_attrs(model), **attrs})


def channels_of(model: Model, rows: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return all channels of a trace that are numbers of the rows, and their units. If `rows` are derivatives of rows,
    the channels are derivatives of channels.

    Two channels need more: `trace_of` makes the yaw continuous, and adds the energy of springs.
    """
    channels: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}

    def put(name: str, unit: str, values: np.ndarray) -> None:
        channels[name], units[name] = values.copy(), unit

    # Channels of each wheel, then of the suspension and the base.
    put("t_s", "s", rows["t"])
    q, v, record, duty, energy = (rows[name] for name in ("q", "v", "record", "duty", "energy"))
    for i, wheel in enumerate(model.rover.wheels):
        put(f"duty_{wheel.name}", "-", duty[:, i])
        put(f"wheel_rate_{wheel.name}", "rad/s", v[:, wheel.dof])
        put(f"current_{wheel.name}_A", "A", record[:, i, RECORD.index("current")])
        for channel, unit in WHEEL_CHANNELS.items():
            put(f"{channel}_{wheel.name}", unit, record[:, i, RECORD.index(channel)])
    for name, index in model.rover.angles.items():
        put(name, "rad", q[:, index])
    for i, axis in enumerate("xyz"):
        put(f"body_{axis}", "m", q[:, i])
    for i, name in enumerate(("roll", "pitch", "yaw")):
        put(f"body_{name}", "rad", rows["attitude"][:, i])
    for i, axis in enumerate("xyz"):
        put(f"body_v{axis}", "m/s", rows["velocity"][:, i])
    put("battery_V", "V", record[:, 0, RECORD.index("supply")])
    # The last term of the energy account belongs to body effects, and is zero without them.
    for i, name in enumerate(ENERGY if model.body_effects else ENERGY[:-1]):
        put(f"energy_{name}", "J", energy[:, i])
    # The torque between the rockers, and the mechanical energy of the whole rover.
    if model.rover.differential is not None:
        put("differential_torque", "N m", rows["differential"])
    put("energy_kinetic", "J", rows["mechanical"][:, 0])
    put("energy_potential", "J", rows["mechanical"][:, 1])
    return channels, units


def elastic_energies(model: Model, rows: np.ndarray) -> np.ndarray:
    """Return the energy [J] that the springs of the body effects store at each row. It is a part of `energy_body`."""
    stored = elastic_energy(model.body_effects, joints_of(model.rover))
    q, places = rows["q"], suspension_places(model.rover)
    return np.array(stored.map(len(q))(q[:, :7].T, q[:, places].T)).ravel()


def model_attrs(model: Model) -> dict[str, Any]:
    """Return the attributes of a trace that describe its model, such as the names of rover, wheels and effects, the
    motion resistance R, gravity, the version of the package, and notes.
    """
    # Effects that depend on the traction law have the same traction form, so that the first form found is that of the
    # traction law.
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
    """Return notes on properties of a model that a user may not expect, one sentence for each.

    There are three possible notes: driven wheels skid on level ground; effects that change the sinkage neither cost nor
    save energy; wheels rise without work if their slip falls.
    """
    # Wheels that skid: the declared resistance is less than the shear at no slip.
    sentences = []
    tractions = [effect for effect in model.effects if isinstance(effect, SoilTraction)]
    if tractions:
        R = sum(float(effect.R) for effect in model.effects if isinstance(effect, MotionResistance))
        level = model.soils[0], model.rover, tractions[0], model.gravity
        slip = level_slip(R, *level)
        if slip:
            sentences.append(
                f"The motion resistance R = {R:.3g} is less than the traction factor F(0) = "
                f"{traction_factor(0.0, *level):.3g} of this soil at zero slip, so that driven wheels skid at S = "
                f"{slip:.2g} on level ground; leave R out, or give a larger R."
            )
    # Effects that change the sinkage do not change R, and only the net form contains the compaction resistance.
    unpaid = [type(effect).__name__ for effect in model.effects if effect.unpaid]
    if unpaid and any(traction.leaves_compaction_out for traction in tractions):
        names, form = f"{', '.join(unpaid)} change{'s' * (len(unpaid) == 1)}", tractions[0].form.name
        sentences.append(
            f"{names} the sinkage of the wheels, but with the traction form {form} this neither costs nor saves "
            "energy, because the motion resistance R does not change; with form=net and angles=sinkage, sinking costs "
            "energy."
        )
    # The depth follows the present slip, so that a falling slip lifts the wheel without work.
    for effect in model.effects:
        if type(effect) in PAYING_EFFECTS:
            sentences.append(
                f"{type(effect).__name__} lifts a wheel like a spring when its slip falls, although sand returns no "
                f"energy; the effect {PAYING_EFFECTS[type(effect)].__name__} adds the work of this lift."
            )
    return sentences
