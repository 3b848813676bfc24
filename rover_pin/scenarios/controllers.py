"""Ready-made controllers by the words that settings have for them."""

import math
from typing import Any

from rover_pin.base.arguments import spec
from rover_pin.base.errors import ParameterError
from rover_pin.base.public import SHORT, fits, words
from rover_pin.base.quantity import parse_quantity
from rover_pin.base.settings import Settings
from rover_pin.base.trust import Trust
from rover_pin.control.constant import ConstantDuty
from rover_pin.control.design.controller_file import controller_of_file
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.motion.kinematics import steers
from rover_pin.control.motion.route import RouteControl, read_route
from rover_pin.control.motion.servo import HeldSpeeds, Servo, cruise_speed
from rover_pin.control.sensing.odometry import Camera, TrackedSlip, Tracker, VisualOdometry
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.stop import Stop, StopStuck
from rover_pin.control.slip_control import HOLE_GAINS, Gains, SlipControl, load_gains, load_hole
from rover_pin.control.slip_estimate import SlipEstimate, TableEstimate, TrueSlip, flat_table
from rover_pin.control.steering import Crab, Turn
from rover_pin.control.torque_check import LOST_SLIP, NoLimit, TorqueLimit, TorqueLimited
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.rover.wheel_base import base_of, effective_track
from rover_pin.scenarios.side_force_choice import TURNS
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.defaults import scale
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.timing import CONTROL_PERIOD

CONTROLS = ("none", "limit", "eq9", "onboard", "camera", "tracked", "true", *TURNS)
RADIUS = 1.0
"""Radius [m] of a turn of Nexus 6; that of another rover is larger as its wheels are."""
ROUTE = ((1.0, 0.0), (2.0, 0.6), (3.0, 0.6))
"""Way-points x, y [m] of Nexus 6 where none are given."""
SLIP_LIMIT = spec("", "assumed: the slip whose torque is the limit", 0.0, 1.0)
AIMS = ("constant", "hole")
STOPS = {"stuck": True, "never": False}
SEED = 1
"""Of the noise of a scenario's camera or tracker."""
NOISE_SEED = spec("", "assumed: any whole number does", 0.0, 2.0**31)
LIMITS = ("none", "saturation", "at-slip")


def controller_from(request: Settings, model: Model, trust: Trust) -> Controller:
    """Return the controller that `control` and `control.FIELD` ask for; a file of one must be trusted."""
    source = "none: constant duty; eq9: paper, Eq 9"
    if not isinstance(request.values.get("control", ""), str):
        return _own(request.take("control", "none", CONTROLS, source))
    if str(request.values.get("control", "")).endswith(".py"):
        return controller_of_file(request.take("control", "none", CONTROLS, source), model, trust)
    kind = request.choice("control", "none", {name: name for name in CONTROLS}, source)
    if kind in ("none", "limit"):
        constant = ConstantDuty(**request.record("control", ConstantDuty))
        limit = _limit(request, model, "none" if kind == "none" else "at-slip")
        return constant if isinstance(limit, NoLimit) else TorqueLimited(constant, limit)
    if kind in ("turn", "point-turn"):
        return _turn(request, model, 0.0 if kind == "point-turn" else scale(model.rover) * RADIUS)
    if kind in ("cmd-vel", "rates"):
        return _held_speeds(request, model, kind)
    if kind == "route":
        return _route(request, model)
    if kind == "crab":
        return Crab.of(model.rover, **request.arguments("control", Crab.of, {}, ("angle", "delta")))
    estimate = _estimate(kind, model, request)
    if not isinstance(estimate, OnboardSlip):
        return _slip_control(request, model, estimate, "constant")
    slip_control = _slip_control(request, model, estimate, "hole")
    stop = request.choice("control.stop", "stuck", STOPS, "beyond the paper: a rover that is stuck digs on")
    return StopStuck(slip_control, estimate, Stop(**request.record("control.stop", Stop))) if stop else slip_control


def drives_straight(request: Settings) -> bool:
    """Return whether the control is one of those that tell no left from right; one of your own may."""
    kind = request.known["control"].value
    return isinstance(kind, str) and kind in CONTROLS and kind not in TURNS


def _turn(request: Settings, model: Model, radius: float) -> Turn | HeldSpeeds:
    """Return a turn by duties and steering; where no wheel steers, by the sides' speeds, which servos hold."""
    defaults = {"radius": radius, "delta": CRUISE_DUTY}
    chosen = {**defaults, **request.arguments("control", Turn.of, defaults, ("radius", "delta"))}
    if any(steers(model.rover)):
        return Turn.of(model.rover, **chosen)
    sides = {"track": _track(request, model)}
    sides |= request.arguments("control", HeldSpeeds.of, sides, ("track",))
    return HeldSpeeds.turning(model.rover, model.motor, **chosen, **sides)


def _track(request: Settings, model: Model) -> float:
    """Return the effective track [m] of a rover without steering on its soil, which holds tan phi of the load."""
    if "control.track" in request.values:
        return 0.0
    R = sum(float(effect.R) for effect in model.effects if isinstance(effect, MotionResistance))
    return effective_track(model.rover, R / math.tan(float(model.soils[0].phi)))


def turning_note(request: Settings, model: Model, controller: Controller) -> tuple[str, ...]:
    """Return what is to be said of a turn by the sides' speeds."""
    if request.known["control"].value not in ("turn", "point-turn") or not isinstance(controller, HeldSpeeds):
        return ()
    return (
        f"turn: no wheel steers, so servos hold the speeds of its sides, for a track of {controller.track:.3g} m "
        f"({base_of(model.rover).track:.3g} between the wheels; the rest makes up for scrub and resistance)",
    )


def _held_speeds(request: Settings, model: Model, kind: str) -> HeldSpeeds:
    """Return a body speed and yaw rate, or rates of all wheels, held by servos."""
    rover, motor = model.rover, model.motor
    servo, limit = Servo(**request.record("control.servo", Servo)), _limit(request, model, "none")
    if kind == "rates":
        rates = {"rates": (CRUISE_DUTY * float(motor.no_load_rate),) * len(rover.wheels)}
        rates |= request.arguments("control", HeldSpeeds.at, rates, ("rates",))
        return HeldSpeeds.at(rover, motor, rates["rates"], servo, limit)
    steered = any(steers(rover))
    defaults = {"speed": cruise_speed(rover, motor), "track": 0.0 if steered else _track(request, model)}
    names = ("speed", "yaw_rate", "crab" if steered else "track")
    chosen = {**defaults, **request.arguments("control", HeldSpeeds.of, defaults, names)}
    return HeldSpeeds.of(rover, motor, **chosen, servo=servo, limit=limit)


def _route(request: Settings, model: Model) -> RouteControl:
    """Return what drives a route from where the rover starts; usual way-points are further apart for larger wheels."""
    size, rover, motor = scale(model.rover), model.rover, model.motor
    default_route = " ".join(f"{size * x:.3g},{size * y:.3g}" for x, y in ROUTE)
    words = str(
        request.take("control.route", default_route, source="way-points x,y x,y ... [m], or a file of x_m, y_m")
    )
    start = tuple(parse_quantity(request.values.get(f"start.{axis}", 0.0), "m", f"start.{axis}") for axis in "xy")
    defaults = {"speed": cruise_speed(rover, motor), "lookahead": 2.0 * base_of(rover).length}
    if not any(steers(rover)):
        defaults["track"] = _track(request, model)
    chosen = {**defaults, **request.arguments("control", RouteControl.of, defaults, defaults)}
    servo, limit = Servo(**request.record("control.servo", Servo)), _limit(request, model, "none")
    return RouteControl.of(rover, motor, read_route(words, (start[0], start[1])), **chosen, servo=servo, limit=limit)


def _slip_control(request: Settings, model: Model, estimate: SlipEstimate, usual_aim: str) -> SlipControl:
    """Return the slip law, its desired slip constant or by each wheel's hole, with usual gains for either."""
    file = request.take("control.gains", None, source="a file of tuned gains, as tune writes it")
    r = float(model.rover.wheel.r)
    tuned = None if file is None else load_hole(str(file), r)
    source = "constant: paper, section 5; hole: beyond the paper"
    usual_aim = usual_aim if file is None else "hole" if tuned else "constant"
    aim, hole = request.choice("control.aim", usual_aim, {name: name for name in AIMS}, source), None
    if aim == "hole":
        of_rover = tuned or HoleLaw(r=r)
        hole = of_rover.replace(**request.record("control.hole", of_rover))
    gains = load_gains(str(file)) if file is not None else HOLE_GAINS if hole else Gains()
    gains = gains.replace(**request.record("control", gains))
    return SlipControl(gains, estimate, _limit(request, model, "saturation"), hole=hole)


def _own(value: Any) -> Controller:
    """Return a controller in memory."""
    if not fits(value, Controller):
        raise ParameterError(
            f"control = {SHORT.repr(value)} is not allowed: give {words(Controller)} and returns duties in [-1, 1], or "
            f"one of {', '.join(CONTROLS)}, or a .py file of one; a constant duty is control.delta=0.3."
        )
    controller: Controller = value
    return controller


def _estimate(kind: str, model: Model, request: Settings) -> SlipEstimate | OnboardSlip:
    if kind == "true":
        return TrueSlip()
    if kind == "tracked":
        tracker = Tracker(**request.record("control.tracker", Tracker))
        return TrackedSlip(model.rover.radii, tracker, CONTROL_PERIOD, _seed(request))
    if kind == "onboard":
        return OnboardSlip.of(model)
    if kind == "camera":
        camera = Camera(**request.record("control.camera", Camera))
        return OnboardSlip.of(model, odometry=VisualOdometry(camera, CONTROL_PERIOD, _seed(request)))
    return TableEstimate(flat_table(model), float(model.rover.wheel.r))


def _seed(request: Settings) -> int:
    """Return the seed of the noise of a camera or tracker."""
    seed = request.number("control.seed", SEED, NOISE_SEED)
    if seed != int(seed):
        raise ParameterError(f"control.seed = {seed:g} is not allowed: give a whole number.")
    return int(seed)


def _limit(request: Settings, model: Model, default: str) -> TorqueLimit | NoLimit:
    word = request.choice("control.limit", default, {name: name for name in LIMITS}, "paper, Fig 9: the torque check")
    if word == "none":
        return NoLimit()
    if word == "saturation":
        return TorqueLimit.saturation(model)
    return TorqueLimit.at_slip(model, request.number("control.slip_limit", LOST_SLIP, SLIP_LIMIT))
