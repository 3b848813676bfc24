"""What the on-board estimate believes about soil, resistance and motors: a model, and how uncertain its numbers are.

The belief is independent of the model that is driven (the plant). Start at `ControllerBelief`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar, Soil
from rover_pin.control.torque_factor import torque_factors
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.soils import HARD_GROUND
from rover_pin.simulation.model.defaults import driven_soil, usual_angles, usual_slip
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.soil.wheel_forces import FORMS
from rover_pin.terrain import shapes

NODES = (-math.sqrt(1.5), 0.0, math.sqrt(1.5))
"""Values of an uncertain number that the estimate considers, in SDs from its mean. The three values are equally likely,
and have the mean and the SD of the number."""


@dataclass(frozen=True)
class BeliefSD(Record):
    """The uncertainty of what an on-board estimate believes: standard deviations (SD) of its soil, of its motion
    resistance, and of its motors. If all of them are 0, the estimate takes its model for certain.
    """

    k: Scalar = quantity(0.4, "", "assumed: SD of ln k, a soil that is known by its name", 0.0, 3.0, "SD(ln k)")
    strength: Scalar = quantity(0.1, "", "assumed: relative SD of the soil's strength, 3 deg of phi", 0.0, 1.0)
    torque: Scalar = quantity(0.05, "", "assumed: relative SD of the torque constant", 0.0, 1.0)
    resistance: Scalar = quantity(0.03, "", "assumed: SD of R, of a cable included", 0.0, 1.0, "SD(R)")


CERTAIN = BeliefSD(k=0.0, strength=0.0, torque=0.0, resistance=0.0)
"""The uncertainty of an estimate that takes its model for certain."""


UNKNOWN_SAND = BeliefSD(k=0.6, strength=0.15, torque=0.05, resistance=0.2)
UNKNOWN_K, UNKNOWN_PHI, UNKNOWN_R = 0.02, math.radians(34.0), 0.1
"""The belief about a sand of which nothing is known. UNKNOWN_K [m] and UNKNOWN_PHI [rad] are the means of the shear
displacement k (on a logarithmic scale) and of the friction angle phi of the soils in `SOILS`, and UNKNOWN_SAND has
their scatter. The motion resistance UNKNOWN_R [-] and its SD are assumed; they cover the usual values from 0.02 to
0.25, so that the balance of forces hardly counts."""


@dataclass(frozen=True)
class ControllerBelief:
    """What a controller believes about the rover, its motors and the soil: a model and the uncertainty of its numbers.

    The belief is no copy of the model that is driven (the plant). Only `of_plant` gives the plant's own numbers.
    """

    model: Model
    "the most probable model"
    sd: BeliefSD
    "uncertainty of its numbers"
    source: str
    "origin of the belief in words, for example `unknown-sand`"

    @classmethod
    def of_plant(cls, plant: Model) -> ControllerBelief:
        """Return the belief of a controller that knows the model that is driven, and takes it for certain."""
        return cls(plant, CERTAIN, "plant")

    @classmethod
    def unknown_sand(cls, plant: Model) -> ControllerBelief:
        """Return the belief of a controller that knows the rover, its motors and the gravity of a model, and nothing
        about the sand.
        """
        soil = driven_soil(plant.rover).value.replace(c=0.0, phi=UNKNOWN_PHI, k=UNKNOWN_K)
        model = on_soil(plant, soil).having(MotionResistance(R=UNKNOWN_R))
        return cls(model, UNKNOWN_SAND, "unknown-sand")

    @classmethod
    def of_soil(cls, plant: Model, name: str) -> ControllerBelief:
        """Return the belief of a controller that knows the rover, its motors and the gravity of a model, and the soil
        by its name in `SOILS`.
        """
        return cls(on_soil(plant, driven_soil(plant.rover, name).value), BeliefSD(), name)

    @classmethod
    def of_models(cls, models: Sequence[Model], source: str) -> ControllerBelief:
        """Return the belief in models that are equally probable, such as the posterior of a loop.

        The k of the models is averaged, and their scatter is the uncertainty of the belief. A single model has the
        uncertainty of a named soil. `source` states the origin of the models.
        """
        middle, usual = models[0], BeliefSD()
        if len(models) == 1:
            return cls(middle, usual, source)
        log_k = np.log([float(model.soils[0].k) for model in models])
        # The torque factor at a large slip contains every cause of strength: phi, c, and the effects of the model.
        log_strength = np.log([float(torque_factors(model, [STRENGTH_SLIP])[0]) for model in models])
        R = [sum(_resistances(model)) for model in models]
        middle = models[int(np.argmin(np.abs(log_strength - np.mean(log_strength))))]
        soil = middle.soils[0].replace(k=math.exp(float(np.mean(log_k))))
        scatter = {"k": np.std(log_k), "strength": np.std(log_strength), "resistance": np.std(R)}
        sd = usual.replace(**{name: float(value) for name, value in scatter.items()})
        return cls(middle.replace(soils=(soil, *middle.soils[1:])), sd, source)

    @property
    def sentence(self) -> str:
        """The belief in a sentence, for the list of what a drive assumes."""
        soil, sd, R = self.model.soils[0], self.sd, sum(_resistances(self.model))
        numbers = f"k = {1e3 * float(soil.k):.3g} mm, phi = {math.degrees(float(soil.phi)):.3g} deg, R = {R:.2g}"
        if sd == CERTAIN:
            return f"controller's belief: {self.source}, taken for certain ({numbers})"
        return (
            f"controller's belief: {self.source} ({numbers}; SD: a factor of {math.exp(float(sd.k)):.2g} in k, "
            f"{100 * float(sd.strength):.2g} % in strength, {float(sd.resistance):.2g} in R, "
            f"{100 * float(sd.torque):.2g} % in the torque constant)"
        )


def highest_strength(sd: BeliefSD) -> float:
    """Return the strength of the strongest soil that an estimate considers, relative to the strength of its model."""
    return math.exp(NODES[-1] * float(sd.strength))


STRENGTH_SLIP = 0.9
"""Slip at which the torque factors of several models are compared [-]. Their scatter is the uncertainty of the soil's
strength."""


def on_soil(plant: Model, soil: Soil, traction: SoilTraction | None = None) -> Model:
    """Return a model of the plant's rover, motors and gravity on a soil, with the usual effects on flat ground.

    `traction` is the law of traction; by default the torque form with the usual contact angles of the rover's wheels.
    """
    traction = traction or SoilTraction(FORMS["torque"], usual_angles(plant.rover))
    effects = base_effects(soil, plant.rover, traction, plant.gravity)
    grounds, springs = (soil, HARD_GROUND), plant.rover.springs
    return Model(
        plant.rover, shapes.flat(), grounds, plant.motor, usual_slip(plant.rover), effects,
        gravity=plant.gravity, body_effects=springs, buried=plant.buried,
    )  # fmt: skip


def _resistances(model: Model) -> list[float]:
    """Return the motion resistances R of a model's effects [-]; the list is empty if its traction contains them."""
    return [float(effect.R) for effect in model.effects if isinstance(effect, MotionResistance)]


@dataclass(frozen=True)
class SoilHypotheses:
    """The soils that an on-board estimate considers. They are equally likely before a drive."""

    factors: np.ndarray
    """torque factors F of each soil (soils, slips) [-]"""
    softness: np.ndarray
    """shear displacement k divided by the strength of each soil (soils,), relative to the model's soil"""
    resistance: float
    """motion resistance R of the model, as a fraction of the weight"""
    sd: BeliefSD
    """uncertainty of the model"""

    @classmethod
    def of(cls, model: Model, sd: BeliefSD, slips: np.ndarray) -> SoilHypotheses:
        """Return the hypotheses about the first soil of a model: combinations of k and strength at NODES, or the soil
        of the model alone if both are certain.
        """
        soil = model.soils[0]
        # An error of the torque constant changes all measured torques, as a stronger or a weaker soil would.
        strength_sd = math.hypot(float(sd.strength), float(sd.torque))
        stretches = [math.exp(float(sd.k) * node) for node in (NODES if sd.k else (0.0,))]
        strengths = [math.exp(strength_sd * node) for node in (NODES if strength_sd else (0.0,))]
        tables = [
            torque_factors(model.replace(soils=(soil.replace(k=soil.k * stretch), *model.soils[1:])), slips)
            for stretch in stretches
        ]
        pairs = list(itertools.product(range(len(stretches)), strengths))
        factors = np.array([strength * tables[at] for at, strength in pairs])
        softness = np.array([stretches[at] / strength for at, strength in pairs])
        return cls(factors, softness, sum(_resistances(model)), sd)
