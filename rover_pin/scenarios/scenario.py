"""Ready-made drives by name, with every number in them open to change: what the command line and sweeps run."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_pin.base.arguments import spec
from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.paths import is_file, named_from
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.public import brief, public
from rover_pin.base.quantity import as_table, quantities
from rover_pin.base.settings import Setting, Settings
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.control.motion.route import RouteControl
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.logs.drive_log import LogMetadata, write_drive_log
from rover_pin.parameters import name_of
from rover_pin.parameters.gravity import GRAVITIES, gravity_named
from rover_pin.scenarios.composed_model import Made, as_it_cruises, compose_model
from rover_pin.scenarios.controllers import controller_from, drives_straight, turning_note
from rover_pin.scenarios.scenes import SCENES, Scene, scale_arguments
from rover_pin.scenarios.side_force_choice import on_its_side
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.defaults import pace, scale, usual_angles
from rover_pin.simulation.model.effect_words import having, words_of
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.simulate import Progress, Timing, simulate
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.timing import MAX_STEP, MIN_STEP
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import ANGLES
from rover_pin.terrain import shapes
from rover_pin.terrain.section import DEEPEST
from rover_pin.terrain.terrain import Terrain
from rover_pin.terrain.toml_table import write_terrain

STEP = spec("s", "the longest step, refined where the ground asks for it", MIN_STEP, MAX_STEP)
DURATION = spec("s", "of the scenario", MIN_STEP)
BURIAL = spec("", "assumed: sunk by half a wheel radius, a drive is over", 0.0, DEEPEST)
WHOLE = {"soil": Soil, "motor": Motor, "start": Start}
"""Settings that may be given whole, as what they set the fields of."""
FRICTION = quantities(GearFriction)["tau_c"]._replace(source="adds GearFriction of this torque at the wheel")


@brief
@dataclass(frozen=True)
class Scenario:
    """A model, its commands, and how long to drive."""

    name: str
    model: Model
    controller: Controller
    duration: float
    start: Start = field(default_factory=Start)
    timing: Timing = field(default_factory=Timing)
    symmetric: bool = False
    settings: Mapping[str, Any] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    "what was assumed for the rover, where neither its TOML nor a setting says it"

    @public
    def drive(self, progress: Progress | None = None, *, measure_error: bool = True) -> Trace:
        """Return the trace of the drive; `measure_error` as of `simulate`."""
        trace = simulate(
            self.model,
            self.controller,
            self.duration,
            self.start,
            self.timing,
            symmetric=self.symmetric,
            progress=progress,
            measure_error=measure_error,
        )
        attributes = {
            "scenario": self.name,
            "control": getattr(self.controller, "__name__", type(self.controller).__name__),
            "settings": dict(self.settings),
            "start": dataclasses.asdict(self.start),
            "assumed": list(self.assumed),
        }
        return dataclasses.replace(trace, attrs={**trace.attrs, **attributes})

    @public
    def write_log(self, trace: Trace, folder: str | Path) -> Path:
        """Write a drive of this scenario as a drive log that declares its terrain, soil, wheel, motor, resistance.

        A rover of one's own is named by the way from the folder to its TOML; contact angles that are not the usual ones
        of its wheels are declared.
        """
        model = self.model
        resistance = [as_table(effect) for effect in model.effects if isinstance(effect, MotionResistance)]
        metadata = LogMetadata.of(trace, self.name)
        metadata = dataclasses.replace(
            metadata,
            rover=self._rover_from(Path(folder)) or model.rover.name,
            gravity=model.gravity,
            angles=_declared_angles(model),
            terrain=write_terrain(folder, model.terrain),
            soil=as_table(model.soils[0]),
            wheel=as_table(model.rover.wheels[0].wheel),
            motor=as_table(model.motor),
            resistance=resistance[0] if resistance else {},
        )
        return write_drive_log(folder, {"run": trace}, metadata)

    def _rover_from(self, folder: Path) -> str:
        """Return the way from a folder to the TOML of a rover of one's own; nothing for one of the package's."""
        rover = Path(str(self.settings.get("rover", "")))
        if "model" in self.settings and "rover" not in self.settings:
            file = Path(str(self.settings["model"]))
            rover = file.parent / str(read_toml(file).get("rover", ""))
        return named_from(folder, rover) if is_file(rover) else ""


def _declared_angles(model: Model) -> str:
    """Return the word for the contact angles; nothing for those that are usual for the rover's wheels."""
    tractions = [traction for traction in model.effects if isinstance(traction, SoilTraction)]
    default_angles = usual_angles(model.rover)
    return next(
        (
            word
            for traction in tractions
            for word, angles in ANGLES.items()
            if default_angles != traction.angles == angles
        ),
        "",
    )


@public
def scenario(name: str, /, **settings: Any) -> Scenario:
    """Return a ready-made drive, changed by dotted settings (pass them as `**{"terrain.wall_angle_deg": 40}`).

    Parameters
    ----------
    name : str
        One of SCENES.
    **settings
        `rover`, `soil` (a name of SOILS, or a `Soil`, taken as it is whatever the wheels' width), `soil.FIELD`,
        `terrain.ARGUMENT` (`terrain.path` of a file), `patch.x_from`, `patch.x_to` (a stretch of hard ground), `motor`
        (speed-like, torque-like: `model.motors`; or a `Motor`), `motor.FIELD`, `gravity` (name or m/s^2),
        `form` (net, torque, gross), `angles` (fixed, sinkage), `slip` (relaxed, algebraic), `gear_friction` [N m],
        `side` (combined, shear: law of the side force; combined where wheels go sideways, see `side_force`),
        `add` (effects, or words for them as "DiggingMemory.c_d=0.1,length=0.05": see `model.effect_words`),
        `effect.CLASS.FIELD`, `cruise_slip` (the slip on the flat, 0.05, that gives the resistance R of soil, wheels and
        load as driven: `model.cruise`; a declared R, or that of a model file, stays), `model` (a drive's model
        file, instead of rover, soil, form, angles and slip; or a wheel rig's, instead of soil, form and angles),
        `trust` (a `Trust`: which files that the model or the rover names may run, or lie elsewhere),
        `buried` (sinkage over wheel radius that ends a drive: 0.5), `control` (none, limit, eq9, onboard, camera,
        tracked, true, turn, point-turn, crab, cmd-vel, rates, route; or any `Controller`: a function of the `Reading`
        that returns a duty;
        true is the slip itself, tracked that of a tracker with noise and delay), `control.FIELD`,
        `control.aim` (S_d constant, or by each wheel's hole), `control.stop` (stuck, never: with onboard and camera),
        `control.gains` (a file of tuned gains), `control.limit` (none, saturation, at-slip: the torque check;
        saturation with a slip, at-slip with limit) and `control.slip_limit`,
        `start.FIELD` or `start` (a `Start`), `duration`, `dt` [s].
        A value may have its unit ("5mm", "30deg"); a `_deg` behind an angle's name reads degrees.

    Returns
    -------
    Scenario
        With `model`, `controller`, `duration` and `drive()`.

    Raises
    ------
    ParameterError
        An unknown name or setting, with the close matches.

    Examples
    --------
    >>> drive = scenario("ditch", **{"soil.k": "10mm", "terrain.wall_angle": "35deg", "duration": 2.0})
    >>> trace = drive.drive()
    >>> str(trace.attrs["stop"]), round(float(trace.t[-1]), 1)
    ('duration', 2.0)
    """
    ready_scenario, _ = _make_scenario(name, settings)
    return ready_scenario


def settings_of(name: str, /, **settings: Any) -> tuple[Setting, ...]:
    """Return what can be set of this scenario, as it is with these settings: what `scenario` takes, with defaults."""
    return tuple(_make_scenario(name, settings)[1].known.values())


def _make_scenario(name: str, settings: Mapping[str, Any]) -> tuple[Scenario, Settings]:
    if name not in SCENES:
        raise ParameterError(f"There is no scenario '{name}': {closest(name, SCENES)}")
    scene = SCENES[name]
    record_names = [name for name, kind in WHOLE.items() if isinstance(settings.get(name), kind)]
    settings = spell_settings(settings, record_names)
    request = Settings({**scene.settings, **settings})
    trust = _trust(request)
    model, assumed, _ = _model(scene, request, trust)
    assumed = tuple(line for line in assumed if line.partition(":")[0] not in record_names)
    controller = controller_from(request, model, trust)
    assumed = (*assumed, *turning_note(request, model, controller))
    start = Start(**request.arguments("start", Start))
    dt = request.number("dt", Timing().dt, STEP)
    scene_duration = scene.duration * pace(model.rover, model.motor)
    default_duration = controller.duration if isinstance(controller, RouteControl) else scene_duration
    duration = request.number("duration", default_duration, DURATION)
    request.finish()
    symmetric = scene.symmetric and model.terrain.mirror_symmetric and start == Start(x=start.x)
    symmetric = symmetric and "model" not in settings and is_mirrored(model) and drives_straight(request)
    final_settings = {name: words_of(value) if name == "add" else value for name, value in settings.items()}
    final_settings = {
        name: value for name, value in final_settings.items() if name != "trust" and value is not controller
    }
    return Scenario(name, model, controller, duration, start, Timing(dt), symmetric, final_settings, assumed), request


def spell_settings(settings: Mapping[str, Any], record_names: Sequence[str]) -> dict[str, Any]:
    """Return settings in which those of `record_names` go by their fields, as soil=Soil(k=0.01) by soil.k=0.01."""
    fields = {f"{name}.{field}": value for name in record_names for field, value in vars(settings[name]).items()}
    if "soil" in record_names and "model" not in settings:
        fields["soil"] = name_of(settings["soil"])
    return {**fields, **{name: value for name, value in settings.items() if name not in record_names}}


def is_mirrored(model: Model) -> bool:
    """Return whether nothing tells left from right: a symmetric rover, no effect of one wheel, none on the body."""
    one_sided = any(hasattr(effect, "wheel") for effect in model.motor_effects)
    return not model.body_effects and not one_sided and model.rover.symmetric


def _terrain(scene: Scene, request: Settings, size: float) -> Terrain:
    preset = scale_arguments(scene.terrain, scene.terrain_settings, size)
    overrides = request.arguments("terrain", scene.terrain, preset)
    if "path" in preset and "path" not in overrides and not is_file(Path(preset["path"])):
        raise ParameterError(
            f"terrain.path names no file yet, and there is no {preset['path']} here: set terrain.path=FILE to that of "
            "your own ground."
        )
    terrain = scene.terrain(**{**preset, **overrides})
    patch = request.arguments("patch", shapes.with_ground, {"x_from": -math.inf, "x_to": math.inf}, ("x_from", "x_to"))
    if patch:
        terrain = shapes.with_ground(terrain, **{"x_from": -math.inf, "x_to": math.inf, **patch}, index=1)
    return terrain


def _model(scene: Scene, request: Settings, trust: Trust) -> Made:
    of_file = request.values.get("model") is not None
    model, assumed, resists = compose_model(request, trust)
    size = scale(model.rover)
    terrain = _terrain(scene, request, size)
    if size != 1.0 and terrain != shapes.flat() and "path" not in scene.terrain_settings:
        assumed = (*assumed, f"terrain: lengths that are not set are those for Nexus 6's wheels times {size:.3g}")
    model, side = on_its_side(model.replace(terrain=terrain), request, scene.askew, of_file)
    assumed = (*assumed, *side)
    ground = model.soils[0].replace(**request.record("soil", model.soils[0]))
    motor = model.motor.replace(**request.record("motor", model.motor))
    gravity = gravity_named(request.take("gravity", model.gravity, GRAVITIES, "or a number in m/s^2"))
    buried = request.number("buried", model.buried, BURIAL)
    model = model.replace(soils=(ground, *model.soils[1:]), motor=motor, gravity=gravity, buried=buried)
    friction = request.number("gear_friction", 0.0, FRICTION)
    if friction:
        model = model.having(GearFriction(tau_c=friction))
    model, resistance = as_it_cruises(model, request, resists)
    model = having(
        model, request.take("add", (), source="effects to add, as DiggingMemory.c_d=0.1: rover-pin list effects"), trust
    )
    for effect in model.all_effects:
        changes = request.record(f"effect.{type(effect).__name__}", effect)
        model = model.having(effect.replace(**changes)) if changes else model
    return Made(model, (*assumed, *resistance), resists)


def _trust(request: Settings) -> Trust:
    """Return what the user trusts, who alone can say it: a study's file cannot. It is no setting to be listed."""
    trust = request.values.pop("trust", Trust())
    if not isinstance(trust, Trust):
        raise ParameterError(f"trust = {trust!r} is not yours to give in a file: say --effects FILE or --trust.")
    return trust
