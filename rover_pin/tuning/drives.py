"""The single evaluations of a tuning, as functions of plain arguments: what workers run and the store remembers."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.errors import DataError, OptimisationError, ParameterError
from rover_pin.base.files.bounded import content
from rover_pin.base.quantity import quantities
from rover_pin.base.settings import Settings
from rover_pin.base.trust import Trust
from rover_pin.control.constant import ConstantDuty
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.slip_estimate import TableEstimate, TrueSlip
from rover_pin.control.torque_check import TorqueLimit, TorqueLimited
from rover_pin.effects.post_peak import PostPeak
from rover_pin.scenarios.controllers import controller_from
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import model_files
from rover_pin.simulation.sensors import Sensed, Sensors
from rover_pin.simulation.trace.trace import Trace
from rover_pin.tuning.drive_score import TAIL, Score, score_outcome, score_trace
from rover_pin.tuning.reduced_model.drive import GAIN_NAMES, Outcome, Reduced
from rover_pin.tuning.reduced_model.effects import omitted_effects
from rover_pin.tuning.reduced_model.loop import Loop
from rover_pin.tuning.study import HOLE, SENSED, DriveCase, SlipLaw, TuningStudy

CONSTANT = "constant"
"""The name of the drive without control, beside those of the estimates."""
CHECKED = "limit"
"""The name of the drive at constant duty under the torque check at a slip, which senses no slip."""
HOLE_NAMES = tuple(name for name in quantities(HoleLaw) if name != "r")


class Control(NamedTuple):
    """Slip control by an estimate of ESTIMATES, `constant` or `limit` (delta_0)."""

    estimate: str
    gains: tuple[float, ...]
    hole: tuple[float, ...] = ()
    "of the hole law; empty where S_d is constant"
    seed: int = 0
    "of the sensors' noise"

    @classmethod
    def of(cls, estimate: str, law: SlipLaw, seed: int = 0) -> Control:
        """Return the control of a law; what reads no sensors has no seed."""
        gains = tuple(law.number(name) for name in GAIN_NAMES)
        hole = tuple(law.number(f"{HOLE}{name}") for name in HOLE_NAMES) if law.hole else ()
        return cls(estimate, gains, hole, seed if estimate in SENSED else 0)

    @property
    def named(self) -> Gains:
        """The gains."""
        return Gains(**dict(zip(GAIN_NAMES, self.gains, strict=True)))

    def controller(self, model: Model) -> Controller:
        """Return the controller for the full rover, as a scenario makes it; what reads sensors has their noise."""
        if self.estimate == CONSTANT:
            return ConstantDuty(self.named.delta_0)
        if self.estimate == CHECKED:
            return TorqueLimited(ConstantDuty(self.named.delta_0), TorqueLimit.at_slip(model))
        numbers = dict(zip(GAIN_NAMES, self.gains, strict=True))
        numbers |= {f"{HOLE}{name}": value for name, value in zip(HOLE_NAMES, self.hole, strict=False)}
        words = {"control": self.estimate, "control.aim": "hole" if self.hole else "constant"}
        if self.estimate in ("camera", "tracked"):
            words["control.seed"] = str(self.seed)
        request = Settings({**words, **{f"control.{name}": value for name, value in numbers.items()}})
        controller = controller_from(request, model, Trust())
        return Sensed(controller, Sensors(), self.seed) if self.estimate in SENSED else controller


FAILED = Score(progress=0.0, slip=1.0, energy=1.0, stuck=1.0, sinkage=1.0, buried=1.0)
"""The score of a drive that the integrator gives up: worse than any that stands still."""


@lru_cache(maxsize=64)
def build(case: DriveCase) -> Scenario:
    """Return the case's scenario, without control.

    Raises ParameterError: an unknown scenario or setting, one that a model file rules out, or settings of the control,
    which the tuning sets itself.
    Raises DataError: a model file that cannot be read, or is no longer the one that was sealed.
    """
    refuse_other_model(case)
    try:
        for name, _ in case.settings:
            if name.split(".")[0] == "control":
                raise ParameterError(f"the setting '{name}' is the tuning's own: leave it out.")
        base_scenario = scenario(case.scenario, **dict(case.settings))
    except ParameterError as error:
        raise ParameterError(f"{case.name}: {error}") from error
    if not case.post_peak:
        return base_scenario
    present = [effect for effect in base_scenario.model.effects if isinstance(effect, PostPeak)]
    lossy = (present or [PostPeak()])[0].replace(fraction=case.post_peak)
    return dataclasses.replace(base_scenario, model=base_scenario.model.having(lossy))


def cautions(cases: Sequence[DriveCase]) -> tuple[str, ...]:
    """Return in a sentence each what of the cases' models the reduced model, or every drive, leaves out."""
    models = [build(case).model for case in cases]
    lost = sorted({name for model in models for name in omitted_effects(model)})
    sensed = sorted({type(effect).__name__ for model in models for effect in model.sensor_effects})
    not_modelled = [f"the search's reduced model leaves out {', '.join(lost)}; the full rover, which decides, has it."]
    only_logged = [f"{', '.join(sensed)} changes what a log says, not what the control reads: no drive here has it."]
    return tuple((not_modelled if lost else []) + (only_logged if sensed else []))


def controller_of(case: DriveCase, control: Control) -> Controller:
    """Return the controller for the full rover."""
    return control.controller(build(case).model)


def drive_full(case: DriveCase, controller: Controller) -> Trace:
    """Return the trace of the full rover under a controller; its doubts are not settled, since no score reads them."""
    return dataclasses.replace(build(case), controller=controller).drive(measure_error=False)


def full_score(case: DriveCase, control: Control) -> list[float]:
    """Return the score of the full rover's drive."""
    scene = build(case)
    return list(score_trace(drive_full(case, controller_of(case, control)), scene.model, scene.duration))


@lru_cache(maxsize=64)
def reduced_of(case: DriveCase, estimate: str) -> Reduced:
    """Return the reduced model of a case."""
    scene = build(case)
    control = controller_of(case, Control.of(estimate, SlipLaw()))
    assert isinstance(control, SlipControl)
    assert isinstance(control.estimate, (TrueSlip, TableEstimate))
    loop = Loop(control.estimate, control.limit)
    return Reduced(scene.model, loop, scene.duration, scene.start.x, TAIL)


@lru_cache(maxsize=64)
def _outcome(case: DriveCase, estimate: str) -> ca.Function:
    """Return gains -> Outcome of the reduced model."""
    return reduced_of(case, estimate).outcome()


def reduced_score(case: DriveCase, control: Control) -> list[float]:
    """Return the score of the reduced model's drive; FAILED where the integrator gives up."""
    reduced = reduced_of(case, control.estimate)
    try:
        # CasADi prints the inputs of a call that fails.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            out = np.array(_outcome(case, control.estimate)(np.array(control.gains))).ravel()
    except RuntimeError:
        return list(FAILED)
    score = score_outcome(Outcome(*out.tolist()), reduced.model, reduced.start, reduced.duration)
    return list(score) if np.all(np.isfinite(score)) else list(FAILED)


def reduced_errors(case: DriveCase, control: Control) -> list[float]:
    """Return how far the reduced drive is from the full one: RMSE of slip [-] and of speed [m/s], end distance [m].

    Infinite where the integrator gives up, or the full drive has no rows.
    """
    trace = drive_full(case, controller_of(case, control))
    if len(trace.t) < 2:
        return [math.inf] * 3
    # The reduced model knows constant duty as a control whose gains are zero.
    gains = control.named
    estimate = control.estimate
    if estimate == CONSTANT:
        gains, estimate = gains.replace(k_p=0.0, k_i=0.0, delta_min=-1.0, delta_max=1.0), "true"
    try:
        reduced = reduced_of(case, estimate).drive(gains, trace.t)
    except OptimisationError:
        return [math.inf] * 3
    axle = [wheel.axle for wheel in build(case).model.rover.wheels]
    slip = np.sqrt(np.mean((reduced["slip"][:, axle] - trace.stack("slip")) ** 2))
    speed = np.sqrt(np.mean((reduced["v"] - trace["body_vx"]) ** 2))
    return [float(slip), float(speed), abs(float(reduced["x"][-1] - trace["body_x"][-1]))]


def seal(study: TuningStudy) -> TuningStudy:
    """Return the study with each drive's model file, if it has one, sealed as it is now.

    Raises DataError, UrdfError: a model file, or one that it names, that cannot be read.
    """
    seals = {file: digest(file) for file in study.model_files}
    return dataclasses.replace(study, training=_with(seals, study.training), held_out=_with(seals, study.held_out))


def refuse_other_model(case: DriveCase) -> None:
    """Refuse a model file that is no longer what it was when the study was sealed.

    Raises DataError: it was changed in the meantime.
    """
    if case.seal and case.seal != digest(case.model_file):
        raise DataError(f"{case.model_file}: the model was changed while it is tuned for: start the tuning again.")


def digest(file: str | Path) -> str:
    """Return a digest of a model file and of all files that it names."""
    hasher = hashlib.sha1()
    for part in model_files(file):
        try:
            raw = content(part)
        except OSError as error:
            raise DataError(f"{file}: {part} cannot be read: {error.strerror}.") from error
        hasher.update(b"%d " % len(raw) + raw)
    return hasher.hexdigest()


def _with(seals: dict[str, str], cases: Sequence[DriveCase]) -> tuple[DriveCase, ...]:
    return tuple(dataclasses.replace(case, seal=seals.get(case.model_file, "")) for case in cases)
