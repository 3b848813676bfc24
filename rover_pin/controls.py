"""Ready-made controllers by the words that settings have for them."""

from __future__ import annotations

from typing import Any

from rover_pin.arguments import about
from rover_pin.control.constant import ConstantDuty
from rover_pin.control.crab import Crab
from rover_pin.control.gains_file import load_gains
from rover_pin.control.onboard_slip import OnboardSlip, SureSlip
from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.slip_estimate import SlipEstimate, TableEstimate, TrueSlip, flat_table
from rover_pin.control.steering import Turn
from rover_pin.control.torque_limit import LOST_SLIP, NoLimit, TorqueLimit, TorqueLimited
from rover_pin.errors import ParameterError
from rover_pin.motion.command import Controller
from rover_pin.motion.defaults import scale
from rover_pin.motion.model import Model
from rover_pin.public import SHORT, fits, words
from rover_pin.settings import Settings

CONTROLS = ("none", "limit", "eq9", "onboard", "true", "turn", "point-turn", "crab")
RADIUS = 1.0
"""Radius [m] of a turn of Nexus 6; that of another rover is larger as its wheels are."""
SLIP_LIMIT = about("", "assumed: the slip whose torque is the limit", 0.0, 1.0)
LIMITS = ("none", "saturation", "at-slip")


def controller_from(asked: Settings, model: Model) -> Controller:
    """Return the controller that `control` and `control.FIELD` ask for."""
    known = "none: constant duty; eq9: paper, Eq 9"
    if not isinstance(asked.values.get("control", ""), str):
        return _own(asked.take("control", "none", CONTROLS, known))
    kind = asked.choice("control", "none", {each: each for each in CONTROLS}, known)
    if kind in ("none", "limit"):
        constant = ConstantDuty(**asked.record("control", ConstantDuty))
        limit = _limit(asked, model, "none" if kind == "none" else "at-slip")
        return constant if isinstance(limit, NoLimit) else TorqueLimited(constant, limit)
    if kind in ("turn", "point-turn"):
        usual = {"radius": 0.0 if kind == "point-turn" else scale(model.rover) * RADIUS}
        return Turn.of(model.rover, **{**usual, **asked.arguments("control", Turn.of, usual, ("radius", "delta"))})
    if kind == "crab":
        return Crab.of(model.rover, **asked.arguments("control", Crab.of, {}, ("angle", "delta")))
    file = asked.take("control.gains", None, source="a file of tuned gains, as tune writes it")
    gains = Gains() if file is None else load_gains(str(file))
    gains = gains.replace(**asked.record("control", gains))
    return SlipControl(gains, _estimate(kind, model), _limit(asked, model, "saturation"))


def _own(given: Any) -> Controller:
    """Return a controller in memory."""
    if not fits(given, Controller):
        raise ParameterError(
            f"control = {SHORT.repr(given)} is not allowed: give {words(Controller)} and returns duties in [-1, 1], or "
            f"one of {', '.join(CONTROLS)}; a constant duty is control.delta=0.3."
        )
    made: Controller = given
    return made


def _estimate(kind: str, model: Model) -> SlipEstimate:
    if kind == "true":
        return TrueSlip()
    if kind == "onboard":
        return SureSlip(OnboardSlip.of(model))
    return TableEstimate(flat_table(model), float(model.rover.wheel.r))


def _limit(asked: Settings, model: Model, usual: str) -> TorqueLimit | NoLimit:
    word = asked.choice("control.limit", usual, {each: each for each in LIMITS}, "paper, Fig 9: the torque check")
    if word == "none":
        return NoLimit()
    if word == "saturation":
        return TorqueLimit.saturation(model)
    return TorqueLimit.at_slip(model, asked.number("control.slip_limit", LOST_SLIP, SLIP_LIMIT))
