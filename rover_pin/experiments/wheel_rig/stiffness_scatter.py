"""Sand that is prepared anew for each level of slip: how much stiffer one bed is than another, by chance."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

from rover_pin.estimation.experiment import Sensitivities
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.random_effects.random_field import Kind, RandomField

MOST = 0.1
"""SD of ln k_1 from which it is not preparation that levels differ by: three times that of CMU's pressings, 3.4 %."""
STIFFNESS = Kind("stiffness of a level's bed", 0.05, "", MOST)
"""Share of k_1 by which beds may differ."""
MIN_BED_LEVELS = 4
"""Levels from which their scatter is distinguished from a law of slip."""


class OnBeds(Protocol):
    """Runs at levels of slip, each level on its own bed."""

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the levels."""

    def uncertain(self, model: Any) -> tuple[Parameter, ...]:
        """Return the uncertain numbers."""

    def value(self, model: Any, name: str) -> float:
        """Return the value of a number."""

    def sensitivities(self, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return prediction and slopes."""


def bed_stiffness_field(experiment: OnBeds, model: Any) -> RandomField | None:
    """Return what every channel of a level would do if its bed were stiffer by STIFFNESS.size; None where k_1 is held.

    ln k_1 of level l is that of all + gamma_l, gamma_l ~ N(0, s^2): pull, torque and sinkage of all runs of the level
    move together, as the model says. Few levels, or a load that is not carried by k_1, tell no s.
    """
    free = {parameter.name: parameter for parameter in experiment.uncertain(model)}
    if "soil.k_1" not in free or not free["soil.k_1"].log or len(experiment.folds) < MIN_BED_LEVELS:
        return None
    stiffer = dataclasses.replace(free["soil.k_1"], scale=STIFFNESS.size)
    u = np.array([stiffer.u(experiment.value(model, stiffer.name))])
    (slope,) = experiment.sensitivities(model, (stiffer,), u).slopes
    levels = np.arange(len(slope))
    responses = np.zeros((len(slope), *slope.shape))
    responses[levels, levels] = np.nan_to_num(slope)
    return RandomField((STIFFNESS,), np.zeros(len(slope), dtype=int), levels, responses)


class RandomEffects(NamedTuple):
    """What the runs of a set share by chance beyond their declared noise, learnt of what a model leaves."""

    stiffness_sd: float = 0.0
    "SD of ln k_1 from level to level; 0 where nothing speaks for one"
    drift: Mapping[str, float] = MappingProxyType({})
    "correlation of successive measurements by channel; empty where the noise does not drift"
    gain: float = 0.0
    "fall of -2 ln of the restricted likelihood against neither"

    @property
    def cautions(self) -> tuple[str, ...]:
        """What a reader should know of it."""
        findings = []
        if self.stiffness_sd:
            findings += [
                f"levels differ by {self.stiffness_sd:.1%} in stiffness by no law of the list, as beds prepared anew do"
            ]
        if self.drift:
            drift_text = ", ".join(f"{name} {rho:.1f}" for name, rho in self.drift.items())
            findings += [f"the noise drifts: a run hangs together with the one measured before it (r: {drift_text})"]
        return tuple(f"{finding}; that is counted as chance, in thresholds and intervals" for finding in findings)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {"beds": self.stiffness_sd, "drift": dict(self.drift), "gain": self.gain}


def learnt_random_effects(fitted: Fit) -> RandomEffects:
    """Return what runs share by the noise of a fit."""
    noise = fitted.task.noise
    if noise.drift is not None:
        rho = map(float, noise.drift.rho)
        return RandomEffects(0.0, dict(zip(fitted.task.experiment.channels, rho, strict=True)), noise.drift.gain)
    return (
        RandomEffects()
        if noise.random_effects is None
        else RandomEffects(noise.random_effects.learnt[0].sd, {}, noise.random_effects.learnt[0].gain)
    )
