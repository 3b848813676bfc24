"""A score test of every candidate: how much its first step would explain that no nuisance parameter can."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from rover_pin.discrepancy.screen import entry_fee
from rover_pin.effects.effect import Effect
from rover_pin.experiments.wheel_rig.calibrate import Setting
from rover_pin.experiments.wheel_rig.candidates import added, sizes, vanished
from rover_pin.experiments.wheel_rig.fit import RigFit
from rover_pin.experiments.wheel_rig.model import NOMINAL, RigModel

STILL = 1e-3
"""A default size that moves no prediction by this many SDs is not in the data at all."""

ALIASED = 0.03
"""A candidate of which nuisance parameters reproduce all but this share cannot be told from them."""

OF_SPEED = 0.05
"""Relative change of an effect's signature with speed from which it needs the speeds."""


class Screened(NamedTuple):
    """What the data can say of one candidate before it is refitted."""

    effect: Effect
    gain: float
    "fall of chi2 that the linearised model predicts"
    visible: float
    "SDs, root of the sum of squares, by which the default size moves what nuisance parameters cannot"
    smallest: float
    "share of the default size that these data would show"
    told: bool
    note: str

    @property
    def name(self) -> str:
        """Name of the effect."""
        return type(self.effect).__name__

    @property
    def shows_from(self) -> str:
        """The smallest size that these data would show, in words: linear in the default size."""
        sizes = self.effect.neutral.items()
        moved = {name: zero + self.smallest * (float(getattr(self.effect, name)) - zero) for name, zero in sizes}
        return f"{self.name} from about " + ", ".join(f"{name} = {size:.2g}" for name, size in moved.items())


def screen(setting: Setting, base: RigFit, kinds: Sequence[type[Effect]]) -> list[Screened]:
    """Return every candidate that the model does not have yet, the most promising first."""
    present = {type(effect).__name__ for effect in base.model.effects}
    fee = entry_fee(len(kinds))
    rows = [_score(setting, base, added(kind, base.model), fee) for kind in kinds if kind.__name__ not in present]
    return sorted(rows, key=lambda row: -row.gain)


def _score(setting: Setting, base: RigFit, effect: Effect, fee: float) -> Screened:
    """Project the signatures of a small and of the default size off the nuisance parameters' and onto the residual."""
    problem = setting.problem(base.model.having(vanished(effect)), (*_extra(base), *sizes(effect)))
    axes, count = problem.space.axes, len(effect.neutral)
    at = problem.space.start()
    residual, jacobian = problem.evaluate(at)
    if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
        return Screened(effect, 0.0, 0.0, math.inf, False, "gives no finite value at its neutral size")
    nuisance, slopes = jacobian[:, :-count], jacobian[:, -count:]
    basis = np.linalg.svd(nuisance, full_matrices=False)[0]
    free = residual - basis @ (basis.T @ residual)
    directions = slopes - basis @ (basis.T @ slopes)
    room = [(-np.inf if at[-count + i] > axes[-count + i].low else 0.0) for i in range(count)]
    reach = [(np.inf if at[-count + i] < axes[-count + i].high else 0.0) for i in range(count)]
    small = _gain(directions, free, np.array(room), np.array(reach))
    moved = _moved(setting, base, effect, problem.measured.size)
    whole = np.zeros_like(residual)
    whole[: moved.size] = -moved
    own = whole - basis @ (basis.T @ whole)
    large = _gain(own[:, None], free, np.zeros(1), np.full(1, np.inf))
    visible = float(np.linalg.norm(own))
    smallest = math.sqrt(fee) / visible if visible > 0 else math.inf
    note = _note(setting, base, effect, float(np.linalg.norm(moved)), visible)
    return Screened(effect, max(small, large) if not note else 0.0, visible, smallest, not note, note)


def _extra(base: RigFit) -> tuple[str, ...]:
    return tuple(name for name in base.problem.space.names if "." in name)


def _gain(directions: np.ndarray, residual: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Return how much a step along `directions`, within bounds, takes off the sum of squares."""
    if not np.isfinite(directions).all() or np.linalg.norm(directions) < 1e-9:
        return 0.0
    free = high > low
    if not free.any():
        return 0.0
    step = lsq_linear(directions[:, free], -residual, (low[free], high[free])).x
    rest = residual + directions[:, free] @ step
    return float(max(residual @ residual - rest @ rest, 0.0))


def _moved(setting: Setting, base: RigFit, effect: Effect, count: int) -> np.ndarray:
    """Return what the effect at its default size moves [SD]; zeros where it carries no load."""
    return np.nan_to_num(_signature(setting, base.model, effect, setting.data.speeds)[:count])


def _signature(setting: Setting, model: RigModel, effect: Effect, speeds: np.ndarray | None) -> np.ndarray:
    sd = np.concatenate([channel.sd for channel in setting.data.rig.channels])
    with_it, without = (
        setting.evidence(one, speeds).predictor(())(one.vector())[0] for one in (model.having(effect), model)
    )
    return np.asarray((with_it - without) / sd)


def _note(setting: Setting, base: RigFit, effect: Effect, moved: float, visible: float) -> str:
    """Return why the data cannot tell the effect, or an empty string."""
    if moved < STILL:
        return "moves nothing that was measured here"
    if visible < ALIASED * moved:
        return f"told from {', '.join(base.problem.space.names)} to {visible / moved:.0%} only"
    if setting.data.speeds is None:
        slow = _signature(setting, base.model, effect, None)
        slip = np.asarray(setting.data.rig.slip)
        fast = 4 * NOMINAL * np.column_stack([1 - np.maximum(slip, 0), 1 + np.minimum(slip, 0)])
        change = np.linalg.norm(_signature(setting, base.model, effect, fast) - slow)
        if change > OF_SPEED * moved:
            return "depends on the speeds, which the set does not have"
    return ""
