"""The evaluations of a tuning: functions that return the score of a drive for given gains, either of the full rover
(the complete simulation) or of the reduced model.

The functions take plain arguments, so that worker processes can run them and `Evaluations` can keep their results.
"""

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
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.control.slip_control import Gains, HoleLaw, SlipControl
from rover_pin.control.slip_estimate import TableEstimate, TrueSlip
from rover_pin.control.torque_check import TorqueLimit, TorqueLimited
from rover_pin.effects.post_peak import PostPeak
from rover_pin.scenarios.controllers import controller_from
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import model_files
from rover_pin.simulation.sensors import NoisyController, Sensors
from rover_pin.simulation.trace.trace import Trace
from rover_pin.tuning.drive_score import TAIL, Score, score_outcome, score_trace
from rover_pin.tuning.reduced_model.drive import GAIN_NAMES, ContinuousControl, ReducedDrive, ReducedOutcome
from rover_pin.tuning.reduced_model.effects import omitted_effects
from rover_pin.tuning.study import HOLE_PREFIX, ON_BOARD, SENSED, DriveCase, SlipLaw, TuningStudy

CONSTANT_DUTY = "constant"
"""Value of `Control.estimate` for the control with a constant duty, which has no slip estimate."""
TORQUE_CHECK = "limit"
"""Value of `Control.estimate` for the control with a constant duty and the torque check, which has no slip estimate."""
HOLE_NAMES = tuple(name for name in quantities(HoleLaw) if name != "r")
"""Names of the numbers of a hole law, in the order of `Control.hole`. The radius r is missing, because it is the wheel
radius of the rover that is driven."""


class Control(NamedTuple):
    """A control as plain values, so that it can be a part of the key of a drive's stored result.

    The control is a slip control, a constant duty, or a constant duty with the torque check.
    """

    estimate: str
    """name of the slip estimate of a slip control, or `constant`, or `limit` for the torque check"""
    gains: tuple[float, ...]
    """gains in the order of GAIN_NAMES; without slip control, only delta_0 is used"""
    hole: tuple[float, ...] = ()
    """numbers of the hole law in the order of HOLE_NAMES; empty if the desired slip is constant"""
    seed: int = 0
    """seed of the sensor noise; 0 if the control reads no sensors"""
    believes: str = ""
    """setting `control.believes` of an on-board slip estimate; empty for its default"""

    @classmethod
    def of(cls, estimate: str, law: SlipLaw, seed: int = 0, believes: str = "") -> Control:
        """Return the control with the slip estimate `estimate` and the numbers in `law`. The seed is used only if the
        estimate reads sensors, and the belief only if the estimate needs a soil (ON_BOARD).
        """
        gains = tuple(law.number(name) for name in GAIN_NAMES)
        hole = tuple(law.number(f"{HOLE_PREFIX}{name}") for name in HOLE_NAMES) if law.hole else ()
        return cls(estimate, gains, hole, seed if estimate in SENSED else 0, believes if estimate in ON_BOARD else "")

    @property
    def gains_record(self) -> Gains:
        """The gains of the control as a record with named fields."""
        return Gains(**dict(zip(GAIN_NAMES, self.gains, strict=True)))

    def controller(self, model: Model, trust: Trust = Trust()) -> Controller:
        """Return the controller for the full rover of a model. A scenario with this control would use an equal
        controller. `trust` states the files of code that the models of the belief may run.

        If the slip estimate reads sensors, the controller gets readings with noise.
        """
        # The two controls without a slip estimate use only the cruise duty of the gains.
        if self.estimate == CONSTANT_DUTY:
            return ConstantDuty(self.gains_record.delta_0)
        if self.estimate == TORQUE_CHECK:
            return TorqueLimited(ConstantDuty(self.gains_record.delta_0), TorqueLimit.at_slip(model))
        # A slip control is made by the settings of a scenario, so that both have one implementation.
        numbers = dict(zip(GAIN_NAMES, self.gains, strict=True))
        numbers |= {f"{HOLE_PREFIX}{name}": value for name, value in zip(HOLE_NAMES, self.hole, strict=False)}
        words = {"control": self.estimate, "control.aim": "hole" if self.hole else "constant"}
        if self.believes:
            words["control.believes"] = self.believes
        if self.estimate in ("camera", "tracked"):
            words["control.seed"] = str(self.seed)
        request = Settings({**words, **{f"control.{name}": value for name, value in numbers.items()}})
        controller = controller_from(request, model, trust)
        return NoisyController(controller, Sensors(), self.seed) if self.estimate in SENSED else controller


FAILED = Score(progress=0.0, slip=1.0, energy=1.0, stuck=1.0, sinkage=1.0, buried=1.0)
"""Score of a drive of the reduced model whose integration fails. It is worse than the score of a rover that does not
move."""


@lru_cache(maxsize=64)
def build(case: DriveCase) -> Scenario:
    """Return the scenario of a drive of a study, with the drive's settings and without a control.

    Raises ParameterError: the scenario or a setting is unknown, the model file excludes a setting, or a setting
    concerns the control, which the tuning itself sets. Raises DataError: the model file cannot be read, or has changed
    since the tuning began.
    """
    # A result of an earlier run must not be mixed with results on a changed model file.
    refuse_other_model(case)
    try:
        for name, _ in case.settings:
            if name.split(".")[0] == "control":
                raise ParameterError(
                    f"the drive has the setting '{name}', but the tuning itself chooses the control: remove this "
                    "setting from the drive."
                )
        base_scenario = scenario(case.scenario, **dict(case.settings))
    except ParameterError as error:
        raise ParameterError(f"{case.name}: {error}") from error
    if not case.post_peak:
        return base_scenario
    # A drive can weaken the soil past its peak stress. If its model already has this effect, only its size changes.
    present = [effect for effect in base_scenario.model.effects if isinstance(effect, PostPeak)]
    post_peak = (present or [PostPeak()])[0].replace(fraction=case.post_peak)
    return dataclasses.replace(base_scenario, model=base_scenario.model.having(post_peak))


def cautions(cases: Sequence[DriveCase]) -> tuple[str, ...]:
    """Return sentences about effects that the models of these drives have, but that the reduced model, or every drive
    of the tuning, leaves out.
    """
    # Both lists have every name once, because many drives share a model.
    models = [build(case).model for case in cases]
    omitted = sorted({name for model in models for name in omitted_effects(model)})
    sensed = sorted({type(effect).__name__ for model in models for effect in model.sensor_effects})
    sentences = []
    if omitted:
        sentences.append(
            f"the reduced model in the search leaves out {', '.join(omitted)}; the full rover, which decides, has them."
        )
    if sensed:
        sentences.append(
            f"{', '.join(sensed)} changes the logged values but not the readings of the control, so no drive has it."
        )
    return tuple(sentences)


def controller_of(case: DriveCase, control: Control) -> Controller:
    """Return the controller for the full rover in the drive `case`, from a control that is given as plain values."""
    return control.controller(build(case).model, dict(case.settings).get("trust", Trust()))


def drive_full(case: DriveCase, controller: Controller) -> Trace:
    """Return the trace of a drive of the full rover (the complete simulation) with a controller.

    The integration error of the drive is not measured, because no score uses it.
    """
    return dataclasses.replace(build(case), controller=controller).drive(measure_error=False)


def full_score(case: DriveCase, control: Control) -> list[float]:
    """Return the score of a drive of the full rover (the complete simulation), as a list in the order of the fields of
    `Score`.
    """
    scene = build(case)
    return list(score_trace(drive_full(case, controller_of(case, control)), scene.model, scene.duration))


@lru_cache(maxsize=64)
def reduced_of(case: DriveCase, estimate: str) -> ReducedDrive:
    """Return the reduced model of a drive, with a slip control whose slip estimate has the name `estimate`."""
    scene = build(case)
    control = controller_of(case, Control.of(estimate, SlipLaw()))
    assert isinstance(control, SlipControl)
    assert isinstance(control.estimate, (TrueSlip, TableEstimate))
    continuous = ContinuousControl(control.estimate, control.limit)
    return ReducedDrive(scene.model, continuous, scene.duration, scene.start.x, TAIL)


@lru_cache(maxsize=64)
def _outcome(case: DriveCase, estimate: str) -> ca.Function:
    """Return the CasADi function of a drive's reduced model, from the gains to the fields of `ReducedOutcome`. The
    function is built on the first call and kept.
    """
    return reduced_of(case, estimate).outcome()


def reduced_score(case: DriveCase, control: Control) -> list[float]:
    """Return the score of a drive of the reduced model, as a list in the order of the fields of `Score`. If the
    integration fails, the result is FAILED.
    """
    reduced = reduced_of(case, control.estimate)
    try:
        # CasADi prints all inputs of a call that fails. The search makes many such calls, so this is suppressed.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            out = np.array(_outcome(case, control.estimate)(np.array(control.gains))).ravel()
    except RuntimeError:
        return list(FAILED)
    score = score_outcome(ReducedOutcome(*out.tolist()), reduced.model, reduced.start, reduced.duration)
    return list(score) if np.all(np.isfinite(score)) else list(FAILED)


def reduced_errors(case: DriveCase, control: Control) -> list[float]:
    """Return the errors of the reduced model on a drive, compared with the full rover (the complete simulation).

    The three errors are the RMSE of the slip [-], the RMSE of the speed [m/s], and the distance between the positions
    at the end [m]. All three are infinite if the integration of the reduced model fails, or if the drive of the full
    rover ends at once.
    """
    trace = drive_full(case, controller_of(case, control))
    if len(trace.t) < 2:
        return [math.inf] * 3
    # In the reduced model, constant duty is a slip control whose gains are 0.
    gains = control.gains_record
    estimate = control.estimate
    if estimate == CONSTANT_DUTY:
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
    """Return a copy of the study with a digest of the model file in each drive. The digest reveals a later change of
    the file.

    Raises DataError or UrdfError: a model file, or a file that it names, cannot be read.
    """
    seals = {file: digest(file) for file in study.model_files}
    training, held_out = (
        tuple(dataclasses.replace(case, seal=seals.get(case.model_file, "")) for case in cases)
        for cases in (study.training, study.held_out)
    )
    return dataclasses.replace(study, training=training, held_out=held_out)


def refuse_other_model(case: DriveCase) -> None:
    """Raise DataError if the model file of a drive has changed since `seal` computed its digest."""
    if case.seal and case.seal != digest(case.model_file):
        raise DataError(f"{case.model_file}: the model file has changed during the tuning. Start the tuning again.")


def digest(file: str | Path) -> str:
    """Return a digest of the contents of a model file and of all files that it names.

    Raises DataError: one of these files cannot be read.
    """
    hasher = hashlib.sha1()
    # The length is hashed with the content, so that moving bytes from one file to the next changes the digest.
    for part in model_files(file):
        try:
            raw = content(part)
        except OSError as error:
            raise DataError(
                f"{file}: the file {part}, which this model needs, cannot be read: {error.strerror}."
            ) from error
        hasher.update(b"%d " % len(raw) + raw)
    return hasher.hexdigest()
