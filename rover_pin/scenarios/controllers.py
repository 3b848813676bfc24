"""The ready-made controllers that the words of the setting `control` name. Start at `controller_from`."""

import dataclasses
import functools
import math
from pathlib import Path

from rover_pin.base.arguments import spec
from rover_pin.base.errors import ParameterError, one_of
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.public import SHORT, fits, words
from rover_pin.base.quantity import parse_quantity
from rover_pin.base.settings import Settings
from rover_pin.base.trust import Trust
from rover_pin.control.design.controller_file import controller_of_file
from rover_pin.control.motion.kinematics import steers
from rover_pin.control.motion.route import RouteControl, read_route
from rover_pin.control.motion.servo import HeldSpeeds, Servo, cruise_speed
from rover_pin.control.open_loop import ConstantDuty, Crab, Turn
from rover_pin.control.sensing.odometry import Camera, TrackedSlip, Tracker, VisualOdometry
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.soil_belief import ControllerBelief, highest_strength, on_soil
from rover_pin.control.sensing.stop import Stop, StopStuck
from rover_pin.control.slip_control import HOLE_GAINS, Gains, HoleLaw, SlipControl, load_gains, load_hole
from rover_pin.control.slip_estimate import SlipEstimate, TableEstimate, TrueSlip, flat_table
from rover_pin.control.torque_check import LOST_SLIP, NoLimit, TorqueLimit, TorqueLimited
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.parameters import SOILS
from rover_pin.rover.wheel_base import base_of, effective_track
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.defaults import scale
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import is_rig_model, models_of, read_model
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD
from rover_pin.terrain import shapes

TURNS = ("turn", "point-turn", "crab", "cmd-vel", "rates", "route")
"""Words of the setting `control` for controls that steer the wheels, or that drive the two sides at different
speeds."""
CONTROLS = ("none", "limit", "eq9", "onboard", "camera", "tracked", "true", *TURNS)
"""All words of the setting `control`."""
RADIUS = 1.0
"""Default radius of a turn of the rover Nexus 6 [m]. For another rover the radius is scaled with the size of the
wheels."""
ROUTE = ((1.0, 0.0), (2.0, 0.6), (3.0, 0.6))
"""Default waypoints (x, y) of a route of the rover Nexus 6 [m]. For another rover they are scaled with the size of the
wheels."""
SLIP_LIMIT = spec("", "assumed: the slip whose torque is the limit", 0.0, 1.0)
AIMS = ("constant", "hole")
"""Words of the setting `control.aim`: the desired slip is constant, or follows the depth of each wheel's hole."""
STOPS = {"stuck": True, "never": False}
"""Word of the setting `control.stop` -> whether the controller stops a rover that is stuck."""
SEED = 1
"""Default seed of the random noise of a camera or a tracker."""
NOISE_SEED = spec("", "assumed: any whole number", 0.0, 2.0**31)
UNKNOWN, PLANT = "unknown-sand", "plant"
"""Words of the setting `control.believes`: the controller knows nothing about the sand, or knows the model that is
driven."""
LIMITS = ("none", "saturation", "at-slip")
"""Words of the setting `control.limit`, which chooses how the control limits the wheel torque."""


def controller_from(request: Settings, model: Model, trust: Trust) -> Controller:
    """Return the controller that the settings `control` and `control.FIELD` describe.

    Parameters
    ----------
    request : Settings
        The user's settings. `control` is a word of CONTROLS, a controller in memory, or the path of a .py file.
    model : Model
        The model that is driven; default numbers depend on its rover, motor and soil.
    trust : Trust
        The user's consent to run files of code.

    Raises RoverPinError: a word or number is not allowed, or `trust` does not allow a file of code.
    """
    source = "none: constant duty; eq9: paper, Eq 9"
    # First possibility: a controller in memory, that is a function that returns duties.
    if not isinstance(request.values.get("control", ""), str):
        value = request.take("control", "none", CONTROLS, source)
        if not fits(value, Controller):
            raise ParameterError(
                f"control = {SHORT.repr(value)} is not allowed: give {words(Controller)} and returns duties in [-1, "
                f"1], or one of {', '.join(CONTROLS)}, or a .py file with a controller. A constant duty is "
                "control.delta=0.3."
            )
        controller: Controller = value
        return controller
    # Second possibility: a user's file, which runs only with the user's consent.
    if str(request.values.get("control", "")).endswith(".py"):
        return controller_of_file(request.take("control", "none", CONTROLS, source), model, trust)
    # Third possibility: a word for a ready-made control.
    kind = request.choice("control", "none", {name: name for name in CONTROLS}, source)
    if kind in ("none", "limit"):
        constant = ConstantDuty(**request.record("control", ConstantDuty))
        limit = _limit(request, model, "none" if kind == "none" else "at-slip")
        return constant if isinstance(limit, NoLimit) else TorqueLimited(constant, limit)
    if kind in ("turn", "point-turn"):
        defaults = {"radius": 0.0 if kind == "point-turn" else scale(model.rover) * RADIUS, "delta": CRUISE_DUTY}
        chosen = {**defaults, **request.arguments("control", Turn.of, defaults, ("radius", "delta"))}
        if any(steers(model.rover)):
            return Turn.of(model.rover, **chosen)
        # Without steering, the rover turns like a tracked vehicle: servos hold different speeds on the two sides.
        sides = {"track": _track(request, model)}
        sides |= request.arguments("control", HeldSpeeds.of, sides, ("track",))
        return HeldSpeeds.turning(model.rover, model.motor, **chosen, **sides)
    if kind in ("cmd-vel", "rates"):
        return _held_speeds(request, model, kind)
    if kind == "route":
        return _route(request, model)
    if kind == "crab":
        return Crab.of(model.rover, **request.arguments("control", Crab.of, {}, ("angle", "delta")))
    # The remaining words are slip controls, which differ in the slip that they feed back: that of the simulation
    # itself, of a tracker, of the table of Eq (9), or of the on-board model, alone or with a camera.
    if kind == "true":
        return _slip_control(request, model, TrueSlip(), "constant")
    if kind == "tracked":
        tracker = Tracker(**request.record("control.tracker", Tracker))
        tracked = TrackedSlip(model.rover.radii, tracker, CONTROL_PERIOD, _seed(request))
        return _slip_control(request, model, tracked, "constant")
    if kind == "eq9":
        table = TableEstimate(flat_table(model), float(model.rover.wheel.r))
        return _slip_control(request, model, table, "constant")
    odometry = None
    if kind == "camera":
        camera = Camera(**request.record("control.camera", Camera))
        odometry = VisualOdometry(camera, CONTROL_PERIOD, _seed(request))
    # The estimate and the torque check know only what the controller believes, which is not the model that is driven.
    belief = _belief(request, model, trust)
    estimate = OnboardSlip.of(belief, odometry=odometry)
    slip_control = _slip_control(request, belief.model, estimate, "hole")
    if isinstance(slip_control.limit, TorqueLimit):
        # The check must not cut a torque that the strongest soil of the belief can bear.
        limit = slip_control.limit.scaled(highest_strength(belief.sd))
        slip_control = dataclasses.replace(slip_control, limit=limit)
    # A rover that is stuck would dig itself in, so that the on-board estimates stop it by default.
    stop = request.choice("control.stop", "stuck", STOPS, "beyond the paper: a rover that is stuck digs itself in")
    return StopStuck(slip_control, estimate, Stop(**request.record("control.stop", Stop))) if stop else slip_control


def belief_words() -> tuple[str, ...]:
    """Return all words of the setting `control.believes`, which may also be the path of a model file or of a folder of
    model files.
    """
    return (UNKNOWN, PLANT, *SOILS)


def _belief(request: Settings, model: Model, trust: Trust) -> ControllerBelief:
    """Return what the controller believes about the soil, from the settings `control.believes` and
    `control.believes.FIELD`.

    `model` is the model that is driven. The controller knows its rover, motors and gravity, and its soil only with
    `control.believes=plant`.
    """
    source = "unknown-sand, plant, rover-pin list soils, a model file, or a folder of model files"
    word = str(request.take("control.believes", UNKNOWN, belief_words(), source))
    if word == PLANT:
        belief = ControllerBelief.of_plant(model)
    elif word == UNKNOWN:
        belief = ControllerBelief.unknown_sand(model)
    elif Path(word).suffix == ".toml" or is_file(Path(word)) or is_folder(Path(word)):
        # A name with the ending .toml is meant as a file, so that a missing file is reported as such.
        belief = ControllerBelief.of_models([_read_believed(file, model, trust) for file in models_of(word)], word)
    else:
        belief = ControllerBelief.of_soil(model, one_of("control.believes", word, belief_words()))
    sd = belief.sd.replace(**request.record("control.believes", belief.sd))
    return dataclasses.replace(belief, sd=sd)


def _read_believed(file: Path, plant: Model, trust: Trust) -> Model:
    """Return the model in a file for a controller's belief. The model of a wheel rig gives soil, traction law and
    effects, and the rover, motors and gravity are those of the model that is driven (`plant`).

    Raises RoverPinError: the file cannot be read.
    """
    if not is_rig_model(str(file)):
        return read_model(file, shapes.flat(), trust)
    rig = read_rig_model(str(file), trust)
    traction = next((effect for effect in rig.effects if isinstance(effect, SoilTraction)), None)
    return functools.reduce(Model.having, rig.effects, on_soil(plant, rig.soil, traction))


def belief_note(controller: Controller) -> tuple[str, ...]:
    """Return a tuple with a sentence on what the controller believes about the soil. The tuple is empty if the
    controller does not estimate the slip on board.
    """
    estimate = getattr(controller, "estimate", None)
    if not isinstance(estimate, OnboardSlip) or estimate.believed is None:
        return ()
    return (estimate.believed.sentence,)


def drives_straight(request: Settings) -> bool:
    """Return whether the control treats the left and the right side of the rover alike.

    For a user's own control the result is False, because its code is unknown.
    """
    kind = request.known["control"].value
    return isinstance(kind, str) and kind in CONTROLS and kind not in TURNS


def _track(request: Settings, model: Model) -> float:
    """Return the effective track [m] of a rover without steering on the model's soil (see `effective_track`).

    The friction coefficient between wheel and soil is taken as tan phi, with the friction angle phi of the soil. The
    result is 0 if a setting states the track.
    """
    if "control.track" in request.values:
        return 0.0
    # The ratio of rolling resistance to sliding friction decides how much the speeds of the sides must differ.
    R = sum(float(effect.R) for effect in model.effects if isinstance(effect, MotionResistance))
    return effective_track(model.rover, R / math.tan(float(model.soils[0].phi)))


def turning_note(request: Settings, model: Model, controller: Controller) -> tuple[str, ...]:
    """Return a tuple with a note for the user if the rover turns by different speeds of its two sides.

    This is so if no wheel can be steered. Otherwise the tuple is empty.
    """
    if request.known["control"].value not in ("turn", "point-turn") or not isinstance(controller, HeldSpeeds):
        return ()
    return (
        f"turn: no wheel steers, so servos hold the speeds of the two sides, for a track of {controller.track:.3g} m "
        f"({base_of(model.rover).track:.3g} m between the wheels; the difference compensates sliding and resistance)",
    )


def _held_speeds(request: Settings, model: Model, kind: str) -> HeldSpeeds:
    """Return a control whose servos hold a body speed and a yaw rate, or the rates of all wheels.

    `kind` is the word of the setting `control`: "cmd-vel" (speed and yaw rate) or "rates" (wheel rates).
    """
    rover, motor = model.rover, model.motor
    servo, limit = Servo(**request.record("control.servo", Servo)), _limit(request, model, "none")
    if kind == "rates":
        rates = {"rates": (CRUISE_DUTY * float(motor.no_load_rate),) * len(rover.wheels)}
        rates |= request.arguments("control", HeldSpeeds.at, rates, ("rates",))
        return HeldSpeeds.at(rover, motor, rates["rates"], servo, limit)
    # A rover with steering can also crab; a rover without steering needs its effective track.
    steered = any(steers(rover))
    defaults = {"speed": cruise_speed(rover, motor), "track": 0.0 if steered else _track(request, model)}
    names = ("speed", "yaw_rate", "crab" if steered else "track")
    chosen = {**defaults, **request.arguments("control", HeldSpeeds.of, defaults, names)}
    return HeldSpeeds.of(rover, motor, **chosen, servo=servo, limit=limit)


def _route(request: Settings, model: Model) -> RouteControl:
    """Return the control that drives along waypoints, beginning at the rover's start.

    The waypoints come from the setting `control.route`. Without this setting, they are ROUTE, scaled with the size of
    the wheels.
    """
    size, rover, motor = scale(model.rover), model.rover, model.motor
    default_route = " ".join(f"{size * x:.3g},{size * y:.3g}" for x, y in ROUTE)
    words = str(
        request.take("control.route", default_route, source="way-points x,y x,y ... [m], or a file with x_m, y_m")
    )
    # The way-points count from the rover's start, which other settings may move.
    start = tuple(parse_quantity(request.values.get(f"start.{axis}", 0.0), "m", f"start.{axis}") for axis in "xy")
    # The look-ahead distance of two wheel bases is long enough that the rover does not swing around the path.
    defaults = {"speed": cruise_speed(rover, motor), "lookahead": 2.0 * base_of(rover).length}
    if not any(steers(rover)):
        defaults["track"] = _track(request, model)
    chosen = {**defaults, **request.arguments("control", RouteControl.of, defaults, defaults)}
    servo, limit = Servo(**request.record("control.servo", Servo)), _limit(request, model, "none")
    return RouteControl.of(rover, motor, read_route(words, (start[0], start[1])), **chosen, servo=servo, limit=limit)


def _slip_control(request: Settings, model: Model, estimate: SlipEstimate, usual_aim: str) -> SlipControl:
    """Return the slip control that feeds back a given slip estimate.

    The desired slip is constant, or follows the depth of each wheel's hole (setting `control.aim`). Without a file of
    tuned gains, `usual_aim` is the default of this setting; with such a file, the default is the law that the gains in
    the file were tuned for.
    """
    file = request.take("control.gains", None, source="a file of tuned gains, as tune writes it")
    r = float(model.rover.wheel.r)
    # A file of tuned gains may hold a law of the desired slip by depth (the hole law).
    tuned = None if file is None else load_hole(str(file), r)
    source = "constant: paper, section 5; hole: beyond the paper"
    usual_aim = usual_aim if file is None else "hole" if tuned else "constant"
    aim, hole = request.choice("control.aim", usual_aim, {name: name for name in AIMS}, source), None
    if aim == "hole":
        of_rover = tuned or HoleLaw(r=r)
        hole = of_rover.replace(**request.record("control.hole", of_rover))
    # Gains that were tuned in a file come first; without a file, each law has its own default gains.
    gains = load_gains(str(file)) if file is not None else HOLE_GAINS if hole else Gains()
    gains = gains.replace(**request.record("control", gains))
    return SlipControl(gains, estimate, _limit(request, model, "saturation"), hole=hole)


def _seed(request: Settings) -> int:
    """Return the seed of the random noise of a camera or a tracker, from the setting `control.seed`.

    Raises ParameterError: the seed is not a whole number.
    """
    seed = request.number("control.seed", SEED, NOISE_SEED)
    if seed != int(seed):
        raise ParameterError(f"control.seed = {seed:g} is not allowed: give a whole number.")
    return int(seed)


def _limit(request: Settings, model: Model, default: str) -> TorqueLimit | NoLimit:
    """Return the torque check that the setting `control.limit` chooses. `default` is the word without this setting.

    A torque check limits the wheel torque to the torque that the soil can bear.
    """
    word = request.choice("control.limit", default, {name: name for name in LIMITS}, "paper, Fig 9: the torque check")
    if word == "none":
        return NoLimit()
    if word == "saturation":
        return TorqueLimit.saturation(model)
    return TorqueLimit.at_slip(model, request.number("control.slip_limit", LOST_SLIP, SLIP_LIMIT))
