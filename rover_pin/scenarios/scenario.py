"""Ready-made drives by name. Every number of a drive can be changed. The command line and batch studies run these
drives.

Start at `scenario`.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.arguments import spec
from rover_pin.base.errors import DataError, ParameterError, UnknownNameError, UrdfError, closest
from rover_pin.base.files.paths import is_file, named_from
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.public import SHORT, brief, public
from rover_pin.base.quantity import WRITTEN, as_table, parse_quantity, quantities
from rover_pin.base.settings import Setting, Settings
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.control.motion.route import RouteControl
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.logs.drive_log import LogMetadata, write_drive_log
from rover_pin.parameters import name_of
from rover_pin.parameters.bekker import POWERS, from_bekker
from rover_pin.parameters.gravity import GRAVITIES, gravity_named
from rover_pin.rover.rover import Rover, load_rover
from rover_pin.scenarios.assumptions import Assumption, assumptions_of
from rover_pin.scenarios.composed_model import ComposedModel, as_it_cruises, compose_model, on_its_side
from rover_pin.scenarios.controllers import belief_note, controller_from, drives_straight, turning_note
from rover_pin.scenarios.drive_file import is_drive_file, with_drive_file, write_drive
from rover_pin.scenarios.scenes import SCENES, Scene, scale_arguments
from rover_pin.simulation.command import Controller
from rover_pin.simulation.engines import COMPILED
from rover_pin.simulation.model.defaults import pace, scale, usual_angles
from rover_pin.simulation.model.effect_words import having, words_of
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.simulate import Progress, Timing, simulate
from rover_pin.simulation.start import Start
from rover_pin.simulation.stepping.timing import MAX_STEP, MIN_STEP
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import ANGLES
from rover_pin.terrain import shapes
from rover_pin.terrain.edits import with_ground
from rover_pin.terrain.files import write_terrain
from rover_pin.terrain.raster import ground_of
from rover_pin.terrain.section import DEEPEST
from rover_pin.terrain.terrain import Terrain

STEP = spec("s", "the longest step; steps are shorter where the ground needs it", MIN_STEP, MAX_STEP)
DURATION = spec("s", "the duration of the scenario", MIN_STEP)
BURIAL = spec("", "assumed: a drive ends if a wheel has sunk by half its radius", 0.0, DEEPEST)
WHOLE = {"soil": Soil, "motor": Motor, "start": Start}
"""Name of a setting that may be given as one object instead of field by field -> class of this object."""
SAVED = ("rover", "soil", "gravity", "control", "control.seed", "terrain.seed", "terrain.path")
"""Settings that `Scenario.save` also writes if the user did not give them, so that a reader of the file sees the drive,
and that later changes of these defaults do not change it. The duration is always written."""
FRICTION = quantities(GearFriction)["tau_c"]._replace(source="adds GearFriction of this torque at the wheel")


@brief
class Origin(NamedTuple):
    """The settings from which a scenario was made, and the objects that were made from them."""

    settings: Mapping[str, Any]
    """name of a setting -> its value: the user's settings without objects in memory, and those in SAVED"""
    in_memory: tuple[str, ...]
    "names of the settings that the user gave as objects in memory, which no file can hold"
    made: tuple[Any, ...]
    """model, controller, start and timing of the scenario as they were made"""


@brief
@dataclass(frozen=True)
class Scenario:
    """A drive that is ready to run: model, controller, duration and start. The method `drive` simulates it.

    Examples
    --------
    >>> ready = scenario("flat", duration=0.5)
    >>> ready.duration, ready.model.rover.name
    (0.5, 'nexus6')
    """

    name: str
    model: Model
    controller: Controller
    duration: float
    "duration of the drive [s], unless a failure ends it earlier"
    start: Start = field(default_factory=Start)
    timing: Timing = field(default_factory=Timing)
    symmetric: bool = False
    """whether the left and the right side of rover and terrain are mirror images, so that only one half is computed"""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """settings that the user has given, without objects in memory"""
    assumed: tuple[str, ...] = ()
    """sentences on assumptions about the rover, where neither its TOML nor a setting states a number"""
    origin: Origin | None = field(default=None, repr=False)
    """the settings that make this drive again, for `save`; None if the object was not made by `scenario`"""
    assumptions: tuple[Assumption, ...] = field(default=(), repr=False)
    """every number and choice that the drive depends on and that the user did not give"""

    @public
    def drive(self, progress: Progress | None = None, *, measure_error: bool = True, engine: str = COMPILED) -> Trace:
        """Simulate the drive, and return its trace (the recorded channels).

        Parameters
        ----------
        progress : callable, optional
            Called with the simulated time [s] during the drive.
        measure_error : bool
            Whether the drive is repeated with half the step until its error is known (see `simulate`).
        engine : str
            The engine that computes the steps: "compiled", "pinocchio-crba" or "pinocchio-aba" (see `simulate`).

        Raises
        ------
        SimulationError
            The drive fails, as in `simulate`; the error has the trace up to the failure.
        """
        # The trace gets the name and the settings of the scenario, so that the drive can be repeated from its file.
        trace = simulate(
            self.model,
            self.controller,
            self.duration,
            self.start,
            self.timing,
            symmetric=self.symmetric,
            progress=progress,
            measure_error=measure_error,
            engine=engine,
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
    def save(self, path: str | Path) -> Path:
        """Write the drive as a TOML file, and return its path. `scenario(path)` makes the same drive from this file.

        The file holds the name of the scenario, the duration, the settings that were given, and the main settings that
        were not given (rover, soil, gravity, control, seeds). Paths are written relative to the folder of the file.

        Parameters
        ----------
        path : str or path
            The file, with the suffix .toml.

        Raises
        ------
        ParameterError
            A file cannot hold this drive: a setting is an object in memory, such as a controller, or the model, the
            controller, the start or the timing was replaced after `scenario` had made the drive.
        DataError
            The path has another suffix, or the file cannot be written.

        Examples
        --------
        >>> path = scenario("flat", duration=0.5).save("my-drive.toml")  # doctest: +SKIP
        >>> trace = scenario(path).drive()  # doctest: +SKIP
        """
        # The fields must still be those objects that the settings have made.
        now = (self.model, self.controller, self.start, self.timing)
        if self.origin is None or any(field is not made for field, made in zip(now, self.origin.made, strict=True)):
            raise ParameterError(
                f"the drive '{self.name}' was changed after scenario(...) had made it, so its settings no longer "
                "describe it: state the change as a setting of scenario(...)."
            )
        if self.origin.in_memory:
            name = self.origin.in_memory[0]
            raise ParameterError(
                f"the setting {name} of the drive '{self.name}' is an object in memory, which a file cannot hold: give "
                f"{name} as a word, as a path, or by its numbers, as `rover-pin list settings` shows them."
            )
        return write_drive(path, self.name, {**self.origin.settings, "duration": self.duration})

    @public
    def write_log(self, trace: Trace, folder: str | Path) -> Path:
        """Write a drive of this scenario as a drive log, and return the log's folder.

        The log states terrain, soil, wheel, motor and motion resistance. It names a user's own rover by the relative
        path from the folder to its TOML. It states the contact angles only if they are not the usual angles of the
        rover's wheels.

        Parameters
        ----------
        trace : Trace
            A drive of this scenario, as `drive` returns it.
        folder : path
            Folder for the log.

        Raises
        ------
        ParameterError
            The rover was given in memory and is not the package's rover with its name, so that a log cannot state it.

        Examples
        --------
        >>> ready = scenario("flat", duration=0.5)
        >>> ready.write_log(ready.drive(), "my-log")  # doctest: +SKIP
        """
        model, rover = self.model, self.model.rover
        if "rover" not in self.settings and "model" not in self.settings:
            # The rover may have been given in memory. A log can state it only if it is the package's rover: if it has
            # the description and the masses of the rover with its name.
            try:
                named = load_rover(rover.name)
            except UrdfError:
                named = None
            inertias = rover.model.inertias.tolist()
            if named is None or named.urdf != rover.urdf or named.model.inertias.tolist() != inertias:
                raise ParameterError(
                    f"rover '{rover.name}' was given in memory and is not the package's rover of this name, so a log "
                    "cannot refer to it. To write a log, give the path of the rover's TOML: scenario(..., rover=PATH)."
                )
        # Your own rover is stated by the path from the log's folder to its TOML, a rover of the package by its name. A
        # model file states its rover by a path from the file's folder.
        path = Path(str(self.settings.get("rover", "")))
        if "model" in self.settings and "rover" not in self.settings:
            file = Path(str(self.settings["model"]))
            path = file.parent / str(read_toml(file).get("rover", ""))
        # Contact angles are stated by their word, and not at all if they are the usual angles of the rover's wheels.
        default_angles = usual_angles(rover)
        angle_words = (
            word
            for traction in model.effects
            if isinstance(traction, SoilTraction)
            for word, angles in ANGLES.items()
            if default_angles != traction.angles == angles
        )
        resistance = [as_table(effect) for effect in model.effects if isinstance(effect, MotionResistance)]
        metadata = LogMetadata.of(trace, self.name)
        metadata = dataclasses.replace(
            metadata,
            rover=(named_from(Path(folder), path) if is_file(path) else "") or rover.name,
            gravity=model.gravity,
            angles=next(angle_words, ""),
            terrain=write_terrain(folder, model.terrain),
            soil=as_table(model.soils[0]),
            wheel=as_table(rover.wheels[0].wheel),
            motor=as_table(model.motor),
            resistance=resistance[0] if resistance else {},
        )
        return write_drive_log(folder, {"run": trace}, metadata)


@public
def scenario(name: str | Path, /, **settings: Any) -> Scenario:
    """Return a ready-made drive, or the drive in a file. The settings change its model, its controller and its
    duration.

    The name of a setting may have a dot, which a Python keyword cannot have. Pass such settings as
    `**{"terrain.wall_angle_deg": 40}`.

    Parameters
    ----------
    name : str or path
        One of SCENES; or the path of a drive file (.toml), as `Scenario.save` writes it. Settings replace those of the
        file.
    **settings
        A value may have a unit ("5mm", "30deg"). An angle whose name ends in `_deg` is in degrees.

        Rover and ground:

        - `rover`: a name, the path of a TOML, or a `Rover`
        - `terrain.ARGUMENT`: arguments of the scene's terrain; `terrain.path` is a file
        - `terrain`: a `Terrain`, or an array of heights [m] with the width of its cells, `terrain.cell`
        - `patch.x_from`, `patch.x_to`: a stretch of hard ground
        - `soil`: a name of SOILS, or a `Soil`, which is not converted to the width of the wheels; `soil.FIELD`, and
          Bekker's `soil.k_c` and `soil.k_phi` with `soil.n`
        - `gravity`: a name or a number [m/s^2]
        - `start.FIELD`, or `start`: a `Start`

        Model:

        - `motor`: speed-like, torque-like or a `Motor`; `motor.FIELD`; `gear_friction` [N m]
        - `form`: net, torque, gross; `angles`: fixed, sinkage; `slip`: relaxed, algebraic
        - `side`: the law of the side force, combined or shear; combined is the default if wheels slide sideways
        - `add`: effects, or words for effects such as "DiggingMemory.c_d=0.1,length=0.05"; `effect.CLASS.FIELD`
        - `cruise_slip`: the slip on level ground, by default 0.05, which determines the motion resistance R; an R that
        a setting or a model file states does not change
        - `model`: the model file of a drive, instead of rover, soil, form, angles and slip; or the model file of a
          wheel rig, instead of soil, form and angles
        - `buried`: the sinkage that ends a drive, as a fraction of the wheel radius, by default 0.5
        - `trust`: a `Trust`, for files that the model or the rover names

        Control:

        - `control`: none, limit, eq9, onboard, camera, tracked, true, turn, point-turn, crab, cmd-vel, rates, route; or
          any `Controller`, a function of the `Reading` that returns a duty. `true` uses the true slip, and `tracked`
          the slip of a tracker with noise and delay
        - `control.FIELD`; `control.gains`: a file of tuned gains
        - `control.aim`: the desired slip, constant or hole (it follows the depth of each wheel's hole);
          `control.stop`: stuck or never, with onboard and camera
        - `control.believes`: what the on-board estimate knows about the soil: unknown-sand (default), plant (it knows
          the model that is driven), a name of SOILS, a model file, or a folder of model files such as a loop's
          posterior; `control.believes.FIELD`: the uncertainty, of `BeliefSD`
        - `control.limit`: the torque check, none, saturation (default with a slip control) or at-slip (default with
          limit); `control.slip_limit`

        Time: `duration` and `dt` [s].

    Returns
    -------
    Scenario
        With `model`, `controller`, `duration` and `drive()`.

    Raises
    ------
    ParameterError
        A name or setting is unknown (the error lists close matches), or a value is not allowed.

    Examples
    --------
    >>> drive = scenario("ditch", **{"soil.k": "10mm", "terrain.wall_angle": "35deg", "duration": 2.0})
    >>> trace = drive.drive()
    >>> str(trace.attrs["stop"]), round(float(trace.t[-1]), 1)
    ('duration', 2.0)
    """
    ready_scenario, _ = _make_scenario(name, settings)
    return ready_scenario


def settings_of(name: str | Path, /, **settings: Any) -> tuple[Setting, ...]:
    """Return every setting of a scenario, or of a drive file, with its default value, unit and source.

    Settings that are given replace their defaults. Defaults that depend on a given setting, such as the numbers of
    another soil, follow this setting.
    """
    return tuple(_make_scenario(name, settings)[1].known.values())


def _make_scenario(name: str | Path, settings: Mapping[str, Any]) -> tuple[Scenario, Settings]:
    """Return a ready-made drive, or the drive in a file, and all its settings, each with its value, unit and source.

    Raises ParameterError: the name or a setting is unknown, or a value is not allowed; the message names the file.
    """
    if not is_drive_file(name):
        return _compose_scenario(str(name), settings)
    trust = settings.get("trust", Trust())
    scene, all_settings = with_drive_file(name, settings, trust if isinstance(trust, Trust) else Trust())
    try:
        return _compose_scenario(scene, all_settings)
    except (ParameterError, DataError) as error:
        given = " with the settings given in addition" if set(settings) - {"trust"} else ""
        kind = next(kind for kind in (UnknownNameError, ParameterError, DataError) if isinstance(error, kind))
        raise kind(f"{name}{given}: {error}") from error


def _compose_scenario(name: str, settings: Mapping[str, Any]) -> tuple[Scenario, Settings]:
    """Return a ready-made drive by the name of its scenario, and all its settings, as `_make_scenario` does."""
    if name not in SCENES:
        raise UnknownNameError(f"There is no scenario '{name}': {closest(name, SCENES)}")
    # The steps below follow the order in which settings depend on each other: ground, model, controller, start, times.
    scene = SCENES[name]
    # Records in memory are written as settings first, so that all code below reads settings only.
    record_names = [name for name, kind in WHOLE.items() if isinstance(settings.get(name), kind)]
    settings = spell_settings(settings, record_names)
    ground = settings.get("terrain")
    settings = {name: value for name, value in settings.items() if name != "terrain"}
    request = Settings({**scene.settings, **settings})
    if ground is not None:
        scene = _scene_on(scene, ground, request)
    # Only the user can state trust, and not a study's file. Trust is therefore no setting and is not listed.
    trust = request.values.pop("trust", Trust())
    if not isinstance(trust, Trust):
        raise ParameterError(f"trust = {trust!r} cannot be stated in a file: use --effects FILE or --trust.")
    model, assumed, _ = _model(scene, request, trust)
    assumed = tuple(line for line in assumed if line.partition(":")[0] not in record_names)
    controller = controller_from(request, model, trust)
    assumed = (*assumed, *turning_note(request, model, controller), *belief_note(controller))
    start = Start(**request.arguments("start", Start))
    # The duration comes last, because a route determines it, and slower rovers get more time.
    dt = request.number("dt", Timing().dt, STEP)
    scene_duration = scene.duration * pace(model.rover, model.motor)
    default_duration = controller.duration if isinstance(controller, RouteControl) else scene_duration
    duration = request.number("duration", default_duration, DURATION)
    request.finish()
    # Half of the drive is computed if nothing in it distinguishes left from right.
    symmetric = scene.symmetric and model.terrain.mirror_symmetric and start == Start(x=start.x)
    symmetric = symmetric and "model" not in settings and is_mirrored(model) and drives_straight(request)
    # A trace keeps its settings as plain values: effects as words, and no objects in memory.
    final_settings = {name: words_of(value) if name == "add" else value for name, value in settings.items()}
    final_settings = {
        name: value
        for name, value in final_settings.items()
        if name != "trust" and value is not controller and not isinstance(value, Rover)
    }
    in_memory = (*(("terrain",) if ground is not None else ()), *settings.keys() - final_settings.keys() - {"trust"})
    timing = Timing(dt)
    # A drive file states the main settings (SAVED) with their values, and then all settings that the user gave.
    saved = {name: request.known[name].value for name in SAVED if name in request.known}
    # A model file states rover and soil itself.
    if "model" in final_settings:
        saved = {name: value for name, value in saved.items() if name not in ("rover", "soil")}
    # A soil in the rover's TOML may change numbers of a named soil; the name alone would be another soil.
    if "soil" not in final_settings and set(model.rover.soil) != {"name"}:
        saved.pop("soil", None)
    saved = {name: int(value) if name.endswith(".seed") else value for name, value in saved.items()}
    origin = Origin({**saved, **final_settings}, in_memory, (model, controller, start, timing))
    listed = assumptions_of(request.known.values(), settings)
    ready = Scenario(
        name, model, controller, duration, start, timing, symmetric, final_settings, assumed, origin, listed
    )
    return ready, request


def _scene_on(scene: Scene, ground: Any, request: Settings) -> Scene:
    """Return a scene whose terrain is replaced by a terrain in memory.

    `ground` is a Terrain, or an array of heights [m] in rows from north to south, as in a .npy file.

    Raises ParameterError: `ground` is neither a Terrain nor an array, or it is an array and the setting `terrain.cell`
    (the width of a cell) is missing.
    """
    if isinstance(ground, Terrain):
        terrain = ground
    elif isinstance(ground, (np.ndarray, list, tuple)):
        # Heights in memory have no file that could state the width of a cell.
        cell = request.values.pop("terrain.cell", None)
        if cell is None:
            raise ParameterError(
                "terrain is an array of heights, but the width of its cells is missing: give it too, for example "
                "**{'terrain.cell': '5cm'}."
            )
        width = parse_quantity(cell, "m", "terrain.cell")
        if not 0.0 < width < math.inf:
            raise ParameterError(f"terrain.cell = {width:g} m is not allowed: give a positive width.")
        missing = str(request.values.pop("terrain.missing", ""))
        terrain = ground_of(np.asarray(ground), width, width, "terrain", missing)
    else:
        raise ParameterError(
            f"terrain = {SHORT.repr(ground)} is not allowed: give a Terrain, or an array of heights [m] with "
            "terrain.cell. For a file use terrain.path of the scenarios grid and polyline."
        )
    return dataclasses.replace(scene, terrain=lambda: terrain, terrain_settings={}, summary=scene.summary or "Your own")


def spell_settings(settings: Mapping[str, Any], record_names: Sequence[str]) -> dict[str, Any]:
    """Return the settings after each object in memory was replaced by one setting for each of its fields.

    For example, soil=Soil(k=0.01) becomes soil.k=0.01 and the other fields of the soil. `record_names` are the names of
    the settings that are such objects. A soil also gets the name of the package's soil that it was derived from, unless
    a model file is given.
    """
    fields = {f"{name}.{field}": value for name in record_names for field, value in vars(settings[name]).items()}
    if "soil" in record_names and "model" not in settings:
        fields["soil"] = name_of(settings["soil"])
    return {**fields, **{name: value for name, value in settings.items() if name not in record_names}}


def is_mirrored(model: Model) -> bool:
    """Return whether the left and the right side of a model are equal, so that a straight drive is symmetric.

    They are equal if the rover is symmetric, and if no effect acts on a single wheel or on the body.
    """
    one_sided = any(hasattr(effect, "wheel") for effect in model.motor_effects)
    return not model.body_effects and not one_sided and model.rover.symmetric


def _model(scene: Scene, request: Settings, trust: Trust) -> ComposedModel:
    """Return the model of a drive on the scene's terrain, and the assumptions that were made for it.

    The model is composed first. Then settings change its terrain, its law of side force, its numbers and its effects.

    Raises ParameterError: the scene needs a file of its terrain, and `terrain.path` is missing.
    """
    of_file = request.values.get("model") is not None
    model, assumed, resists = compose_model(request, trust)
    size = scale(model.rover)
    # The scene's own numbers of the terrain come first, scaled to the wheels, and the user's settings replace them.
    preset = scale_arguments(scene.terrain, scene.terrain_settings, size)
    overrides = request.arguments("terrain", scene.terrain, preset)
    if "path" in preset and "path" not in overrides and not is_file(Path(preset["path"])):
        raise ParameterError(
            f"terrain.path is not set, and there is no {preset['path']} in this folder: set terrain.path=FILE to the "
            "file of your own ground."
        )
    terrain = scene.terrain(**{**preset, **overrides})
    # The stretch of hard ground is laid over the terrain as its second soil.
    patch = request.arguments("patch", with_ground, {"x_from": -math.inf, "x_to": math.inf}, ("x_from", "x_to"))
    if patch:
        terrain = with_ground(terrain, **{"x_from": -math.inf, "x_to": math.inf, **patch}, index=1)
    if size != 1.0 and terrain != shapes.flat() and "path" not in scene.terrain_settings:
        assumed = (*assumed, f"terrain: lengths that are not set are those for Nexus 6's wheels times {size:.3g}")
    model, side = on_its_side(model.replace(terrain=terrain), request, scene.askew, of_file)
    assumed = (*assumed, *side)
    # Bekker's constants soil.k_c and soil.k_phi among the user's settings are replaced by soil.k_1 and soil.k_2. The
    # conversion depends on the width of the model's wheels.
    values = request.values
    given = {name: values[f"soil.{name}"] for name in POWERS if f"soil.{name}" in values}
    if given:
        table = {name: values[f"soil.{name}"] for name in ("n", "k_1", "k_2") if f"soil.{name}" in values}
        for name, value in given.items():
            # A value such as "0.99 kN/m^(n+1)" has a number and a unit, in which n may occur.
            match = WRITTEN.fullmatch(value.strip()) if isinstance(value, str) else None
            unit = (match[2] or match[3] or "").strip() if match else ""
            number = float(match[1]) if match else value
            table[name] = {"value": number, "unit": unit} if unit else {"value": number}
        n = parse_quantity(table.pop("n"), "", "soil.n") if "n" in table else None
        converted = from_bekker(table, float(model.rover.wheels[0].wheel.b), "the settings of soil", n)
        for name in given:
            del request.values[f"soil.{name}"]
        request.values |= {f"soil.{name}": converted[name] for name in ("k_1", "k_2")}
    # Settings such as soil.k, motor.gear and gravity change the composed model.
    ground = model.soils[0].replace(**request.record("soil", model.soils[0]))
    motor = model.motor.replace(**request.record("motor", model.motor))
    gravity = gravity_named(request.take("gravity", model.gravity, GRAVITIES, "or a number in m/s^2"))
    buried = request.number("buried", model.buried, BURIAL)
    model = model.replace(soils=(ground, *model.soils[1:]), motor=motor, gravity=gravity, buried=buried)
    friction = request.number("gear_friction", 0.0, FRICTION)
    if friction:
        model = model.having(GearFriction(tau_c=friction))
    # The resistance R is derived from the final soil, motor and gravity, so that it comes after them.
    model, resistance = as_it_cruises(model, request, resists)
    model = having(
        model,
        request.take("add", (), source="effects to add, such as DiggingMemory.c_d=0.1: rover-pin list effects"),
        trust,
    )
    # Settings effect.CLASS.FIELD change the numbers of effects, those of added effects too.
    for effect in model.all_effects:
        changes = request.record(f"effect.{type(effect).__name__}", effect)
        model = model.having(effect.replace(**changes)) if changes else model
    return ComposedModel(model, (*assumed, *resistance), resists)
