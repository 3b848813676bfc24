"""Use the declarations of rig.toml: uncertain parameters with their priors, and initial values of effects.

`SetNumbers` returns the uncertain parameters of sand, wheel and rig. `presets` returns the values of effect parameters
that follow from the declared lugs and sand, such as the weight of the sand from its density.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.contact import Wheel
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.estimation.parameter import Parameter, declared_in, parameter_of
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.soil_priors import MAX_EXIT_RATIO, SD, known_constant, unknown_constant
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.channel import DrawbarPull, MotorTorque, SideForce, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.rig_set import RigSet

TARE_SD, SCALE_SD, MOTOR_SCALE_SD = 0.1, 0.05, 0.15
"""Prior SD of an offset that is not declared, as a fraction of the channel's largest value; prior SD of a scale that is
not declared; and this SD for the scale of a torque by motor current (all assumed). Force cells are accurate to about 1
%. Torque constants are stated to 10 %, and the efficiency of a gear varies by as much with load and temperature; in one
public set the two torques of a run differ by a quarter."""
OFFSET_AND_SCALE = {
    DrawbarPull: ("pull_tare", "force_scale"),
    Torque: ("torque_tare", "torque_scale"),
    Sinkage: ("sinkage_zero", "sinkage_scale"),
    SideForce: ("side_tare", "side_scale"),
    VerticalMoment: ("moment_tare", "moment_scale"),
    MotorTorque: ("motor_torque_tare", "motor_torque_scale"),
}
"""Channel -> names of its offset and of its scale in `RigErrors`."""
PRESSING, PLATES = "rig.pressing_scale", "rig.plate_scale"
"""Names of the parameters for the soil's stiffness under a pressed wheel, and under a pressed plate, divided by its
stiffness under a rolling wheel."""
PRESSING_SD = 0.3
"""Prior SD of the logarithm of the stiffness ratios `PRESSING` and `PLATES` (assumed)."""


def own_name(name: str) -> str:
    """Return the name of a parameter as `RigModel.names` lists it, that is, without the prefix "soil." or "wheel."."""
    return name.removeprefix("soil.").removeprefix("wheel.")


@dataclass(frozen=True, eq=False)
class SetNumbers:
    """The uncertain parameters of the model of one data set. They belong to the sand, to wheel and rig, and to the
    rig's readings.
    """

    data: RigSet
    model: RigModel

    def of_sand(self) -> list[Parameter]:
        """Return the uncertain soil constants of one data set as parameters with their priors.

        A constant that rig.toml declares in [soil] with an SD is free with this prior. Which other constants are free
        depends on the measured channels. k and phi are free without a prior if a force (pull or torque) was measured.
        k_1 is free without a prior if the sinkage was measured. The exit ratio is always free. n is free if the loads
        differ or if the wheel was pressed in. c is free if the loads differ, and its prior SD is at least as large as c
        itself.
        """
        # A force determines how the stress grows with shear (k, phi), and the sinkage how firm the soil is (k_1).
        rig, soil = self.data, self.model.soil
        kinds = {type(channel) for channel in rig.channels}
        assumed = []
        if kinds & {DrawbarPull, Torque, MotorTorque}:
            assumed += [unknown_constant("soil", soil, "k"), unknown_constant("soil", soil, "phi")]
        if Sinkage in kinds:
            assumed.append(unknown_constant("soil", soil, "k_1"))
        assumed.append(replace(self._of_soil("exit_ratio"), low=0.0, high=MAX_EXIT_RATIO))
        if rig.loads_vary or rig.trials:
            assumed.append(self._of_soil("n"))
        if rig.loads_vary:
            assumed.append(self._of_soil("c", float(soil.c)))
        # A declared prior replaces the assumed one.
        constants = (known_constant("soil", rig.soil(), name, rig.declared, rig.doubts) for name in rig.doubts)
        declared = {parameter.name: parameter for parameter in constants}
        replaced = [declared.pop(parameter.name, parameter) for parameter in assumed]
        return [*replaced, *declared.values()]

    def of_rig(self) -> Iterator[Parameter]:
        """Yield the uncertain parameters of rig and wheel: the pressing scales, and numbers that rig.toml states with
        an SD.

        The pressing scale is the stiffness of the soil under a pressed wheel divided by its stiffness under a rolling
        wheel. It is free if there are pressing trials. A pressing trial presses the wheel into the sand without
        rolling. Trials of plates have a scale of their own. Offset and scale of a torque by motor current are always
        uncertain, so both are free if the torque was measured in this way.
        """
        rig = self.data
        pressed = {PRESSING: any(not of.plate for of in rig.trials), PLATES: any(of.plate for of in rig.trials)}
        for name in (name for name, is_measured in pressed.items() if is_measured and name not in rig.error_sd):
            yield self._parameter(name, PRESSING_SD, log=True)
        for name, sd in {**rig.error_sd, **self._motor_errors()}.items():
            declared = "declared in rig.toml" if name in rig.error_sd else ""
            parameter = self._parameter(name, sd, declared=declared)
            low, high = rig.wheel_range.get(own_name(name), (parameter.low, parameter.high))
            yield replace(parameter, low=low, high=high)

    def reading_errors(self) -> list[Parameter]:
        """Return the errors of the rig's readings that rig.toml does not declare: offset and scale of each channel, and
        load scale.
        """
        # The size of an offset is judged by the largest value of the channel. Errors of a torque by motor current are
        # parameters of every fit (`of_rig`).
        sds = {"rig.load_scale": SCALE_SD}
        for channel in (channel for channel in self.data.channels if not isinstance(channel, MotorTorque)):
            offset, scale = OFFSET_AND_SCALE[type(channel)]
            sds |= {f"rig.{offset}": TARE_SD * float(np.nanmax(np.abs(channel.measured))), f"rig.{scale}": SCALE_SD}
        return [self._parameter(name, sd) for name, sd in sds.items() if name not in self.data.error_sd]

    def _motor_errors(self) -> dict[str, float]:
        """Return the prior SD of offset and scale of a torque by motor current, unless rig.toml declares them; empty
        without this torque.
        """
        offset, scale = OFFSET_AND_SCALE[MotorTorque]
        largest = [np.nanmax(np.abs(of.measured)) for of in self.data.channels if isinstance(of, MotorTorque)]
        sds = {f"rig.{offset}": TARE_SD * float(largest[0]), f"rig.{scale}": MOTOR_SCALE_SD} if largest else {}
        return {name: sd for name, sd in sds.items() if name not in self.data.error_sd}

    def _of_soil(self, name: str, min_sd: float = 0.0) -> Parameter:
        """Return a soil constant as a parameter with the prior SD that is assumed for constants that are not declared.

        The prior SD is at least `min_sd`.
        """
        rig = self.data
        declared = declared_in("soil", name, rig.declared, rig.doubts)
        return self._parameter(f"soil.{name}", max(SD[name].undeclared, min_sd), declared=declared)

    def _parameter(self, name: str, sd: float, log: bool = False, declared: str = "") -> Parameter:
        """Return a parameter of the model whose prior mean is its present value.

        `sd` is the prior SD of the parameter, or of its logarithm if `log` is True. `declared` states the source of the
        prior.
        """
        return parameter_of(name, self.model.records[name.rpartition(".")[0]], sd, log, declared)


LUGS = ("h_l", "h_s")
"""Names of the effect parameters that are the height of a lug. An effect with such a parameter does not act on a wheel
without lugs."""
TRENCH, FULL_BY = "LugExcavation.h_l", 0.3
"""Name of the parameter for the height of digging lugs, and its relative prior SD (assumed). The SD represents the
filling of the pockets between lugs, which is not measured (`studies/wheel_laws.py` compares some)."""
HELD = ("bulk_density",)
"""Keys of rig.toml whose effect parameters stay fixed at the declared number in a fit. Every other effect parameter
starts at its declared number and keeps its usual prior."""
ASSUMED_DENSITY = 1600.0
"""Density of loose dry sand [kg/m^3] in the default of gamma of every effect (assumed). It gives the weight of the sand
under another gravity, if the density is not declared."""
PRESET_UNITS = {"gamma": "N/m^3", "phi_f": "rad", "h_l": "m", "h_s": "m", "filled": ""}
"""Name of an effect parameter that a declaration can preset -> its unit. A parameter with another unit is not
preset."""


class Preset(NamedTuple):
    """Initial or fixed value of an effect parameter that follows from a declaration in rig.toml."""

    name: str
    "name of the effect parameter, such as gamma"
    value: float
    "value in SI"
    source: str
    """key in rig.toml that declares the value"""


def presets(rig: RigSet) -> dict[str, Preset]:
    """Return the values of effect parameters that follow from the declarations of a data set: parameter name -> value.

    gamma = rho g is the specific weight of the sand, with the density rho and the gravity g at the test. Without a
    declared density, a declared gravity gives the initial value of gamma, with rho = 1600 kg/m^3 (assumed). phi_f, the
    friction angle between sand and sand, starts at the angle of repose. h_l and h_s are the height of the lugs.
    `filled` is the fraction of the rim between lugs, E = 1 - N w / (2 pi (r + h_l / 2)) for N lugs of width w on a
    wheel of radius r.
    """
    # `beside` holds the declarations that are no constants of wheel or soil, such as density and lugs.
    declared_values = rig.beside
    declared_presets = {}
    if "bulk_density" in declared_values:
        declared_presets["gamma"] = Preset("gamma", declared_values["bulk_density"] * rig.gravity, "bulk_density")
    elif not rig.gravity_is_assumed:
        declared_presets["gamma"] = Preset("gamma", ASSUMED_DENSITY * rig.gravity, "gravity")
    if "angle_of_repose" in declared_values:
        declared_presets["phi_f"] = Preset("phi_f", declared_values["angle_of_repose"], "angle_of_repose")
    if declared_values.get("lug_height", 0.0) > 0.0:
        declared_presets |= {name: Preset(name, declared_values["lug_height"], "lug_height") for name in LUGS}
        if declared_values.keys() >= {"lug_width", "lug_count"}:
            declared_presets["filled"] = Preset(
                "filled", pockets(declared_values, rig.wheel), "lug_width and lug_count"
            )
    return declared_presets


def pockets(declared_values: Mapping[str, float], wheel: Wheel) -> float:
    """Return the fraction of a wheel's circumference that lies between its lugs; 0 if the lugs leave no gaps.

    The circumference is taken at half the height of the lugs. `declared_values` has the lugs' height and width [m] and
    their number.
    """
    # Lugs that are wider than their spacing leave no gaps, so the fraction is never negative.
    circumference = 2.0 * math.pi * (float(wheel.r) + declared_values["lug_height"] / 2.0)
    return max(1.0 - declared_values["lug_count"] * declared_values["lug_width"] / circumference, 0.0)


def known_trench(rig: RigSet) -> tuple[LugExcavation, ...]:
    """Return the effect of the trench that lugs of the declared height dig, with the volume of sand conserved.

    The result is a tuple with this effect, or an empty tuple if no height of lugs is declared.
    """
    declared_presets = presets(rig)
    if "h_l" not in declared_presets:
        return ()
    return (
        LugExcavation(**{name: declared_presets[name].value for name in ("h_l", "filled") if name in declared_presets}),
    )


def known_heights(rig: RigSet, records: Mapping[str, Any]) -> Iterator[Parameter]:
    """Yield the height of the digging lugs of a model as a free parameter whose prior mean is the declared height.

    The height is uncertain because the pockets between lugs may be partly empty or heaped. The trench depends only on
    the product h_l E of the lug height h_l and the filled fraction E, so h_l gets the relative uncertainty `FULL_BY` of
    E. `records` maps names to the parts of the model. If the model has no digging lugs, nothing is yielded.
    """
    owner = TRENCH.partition(".")[0]
    if owner in records and known_trench(rig):
        height = presets(rig)["h_l"].value
        free = parameter_of(TRENCH, records[owner], 1.0, declared="declared with the lugs, its SD assumed")
        yield dataclasses.replace(free, origin=height, scale=FULL_BY * height)


def preset_candidate(effect: Effect, rig: RigSet) -> Candidate:
    """Return an effect as a candidate whose parameters have the values that rig.toml declares for lugs and sand.

    A declared value is clipped to the bounds of the effect's parameter. The parameters of the keys in `HELD` stay fixed
    in a fit.
    """
    # Fixed numbers are removed from the free shapes of the candidate; all others only change their initial value.
    declared_presets = _of(effect, presets(rig))
    specs = quantities(effect)
    within = {
        preset.name: min(max(preset.value, specs[preset.name].low), specs[preset.name].high)
        for preset in declared_presets
    }
    plain = plain_candidate(effect.replace(**within))
    fixed_names = {f"{plain.kind}.{preset.name}" for preset in declared_presets if preset.source in HELD}
    return dataclasses.replace(plain, shapes=tuple(name for name in plain.shapes if name not in fixed_names))


def is_of_other_wheel(effect: Effect, rig: RigSet) -> bool:
    """Return whether an effect needs lugs although rig.toml declares that the wheel has none."""
    return rig.beside.get("lug_height") == 0.0 and any(name in LUGS for name in effect.neutral)


def describe_declared(rig: RigSet, effects: Sequence[Effect], present: Sequence[Effect] = ()) -> tuple[str, ...]:
    """Return one clause for each declared number of lugs and sand, which states the effects that use the number.

    If no effect uses the number, its clause states this.

    Parameters
    ----------
    rig : RigSet
        The data set with the declarations.
    effects : sequence of Effect
        The effects that were tried as candidates.
    present : sequence of Effect
        The effects of the base model.
    """
    # The trench of the base model comes first, then the presets of candidates, then the unused numbers.
    presets_by_source = {preset.source: preset for preset in presets(rig).values()}
    trench = _owners(rig, [effect for effect in present if isinstance(effect, LugExcavation)])
    tried = _owners(rig, effects)
    lines = [f"{_preset_text(presets_by_source[source], names)}, in the base model" for source, names in trench.items()]
    lines += [_preset_text(presets_by_source[source], names) for source, names in tried.items()]
    if "bulk_density" in tried:
        origin = "assumed to be the Earth's: declare gravity in rig.toml if the test was elsewhere"
        lines.append(f"gravity = {rig.gravity:g} m/s^2, {origin if rig.gravity_is_assumed else 'as declared'}")
    used = " ".join((*trench, *tried))
    unused = [name for name, value in rig.beside.items() if value and name not in used]
    return (*lines, *(f"{name} is declared but not used, because no tried effect depends on it" for name in unused))


def _owners(rig: RigSet, effects: Sequence[Effect]) -> dict[str, list[str]]:
    """Return the effect parameters ("Effect.parameter") that each declared number presets: key of rig.toml ->
    parameters.
    """
    owners: dict[str, list[str]] = {}
    for effect in effects:
        for preset in _of(effect, presets(rig)):
            owners.setdefault(preset.source, []).append(f"{type(effect).__name__}.{preset.name}")
    return owners


def _preset_text(preset: Preset, names: Sequence[str]) -> str:
    """Return the clause that states one declared number and the effect parameters (`names`) that get this number."""
    role = "fixes" if preset.source in HELD else "is the initial value of"
    return f"{preset.source} {role} {', '.join(names)} = {format_value(preset.value, PRESET_UNITS[preset.name])}"


def _of(effect: Effect, declared_presets: Mapping[str, Preset]) -> list[Preset]:
    """Return the presets that an effect can use, because the effect has a parameter of this name and unit."""
    specs = quantities(effect)
    return [
        preset for name, preset in declared_presets.items() if name in specs and specs[name].unit == PRESET_UNITS[name]
    ]
