"""A rover on its ground as a functional mock-up unit: the compiled drive, its numbers written out as C."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil
from rover_pin.control.fmi.unit import MAIN, FunctionalUnit, Variable
from rover_pin.simulation.compiled.generated_laws import laws_source, structure_of
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.suspension import suspension_places
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native import source
from rover_pin.simulation.native.compiled_body import body_source
from rover_pin.simulation.native.loop import Loop
from rover_pin.simulation.native.shared import FIELDS, LOOP_FIELDS, RECORD, c_number, c_table
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.timing import Timing
from rover_pin.simulation.trace.rows import row_type

OF_WHEELS = {
    "current": ("A", "current of each motor"),
    "torque": ("N m", "torque of each motor at the wheel"),
    "slip": ("", "slip ratio of each wheel, Eq (1); a simulator alone knows it"),
    "sinkage": ("m", "sinkage of each wheel"),
    "normal": ("N", "normal force of each wheel"),
    "travel": ("m/s", "speed of each wheel's centre over the ground"),
}
"""Outputs of the record of a row."""
ENDLESS = 2**62
"""Steps of a drive without an end."""
NOWHERE = "0"
SIZED_IN_C = {"step": "&p->step", "held_lanes": "p->held_lanes"}
"""Arrays whose size depends on the processor for which the C is compiled."""
SCALAR = "int {}(const double **, double **, integer *, double *, int)"
OVER_LANES = "void {}(const double *, const double *, const double *, double *)"
LAWS = {"rigid_body": SCALAR, "contact_before": SCALAR, "contact_law": OVER_LANES, "motor_law": OVER_LANES,
        "body_law": SCALAR}  # fmt: skip
"""The struct Drive's functions with their C prototypes."""


def plant(model: Model, start: Start = Start(), timing: Timing = Timing()) -> FunctionalUnit:
    """Return the unit of a model's rover, set down at rest at `start`, on its ground.

    A step is a control period: duties and steering are held, and what is read at its end comes out. The soil's
    constants are parameters that may change at any time. The numbers are those of `simulate`, to the rounding of
    another compiler's elementary functions.

    Raises SimulationError: the rover cannot be set down there.
    """
    drive = set_out(model, lambda reading: 0.0, timing.control, start, timing)
    kernel, period = drive.stepper, round(drive.timing.control / drive.timing.dt)
    assert isinstance(kernel, Kernel)
    loop = Loop(kernel, drive.timing.dt, period, period, per_control=period)
    loop.struct.steps = ENDLESS
    variables, places = _variables(drive.model, kernel)
    laws, (body, body_name) = laws_source(structure_of(drive.model)), body_source(model.rover.model)
    functions = dict(zip(LAWS, (body_name, *laws.names), strict=False))
    lines = [source(), *_places_in_values(variables), c_table("int", "ROW_PLACES", places)]
    lines += [f"#define N_OUT {len(places)}", _Image(kernel, loop, functions).source]
    lines += [text_of_package("rover_pin.control.fmi", "plant.c")]
    return FunctionalUnit(
        "rover_plant",
        f"{model.rover.name} on its ground, by rover-pin",
        timing.control,
        tuple(variables),
        {MAIN: "\n".join(lines), "laws.c": laws.text, "rigid_body.c": body},
    )


def _places_in_values(variables: list[Variable]) -> Iterator[str]:
    """Yield C of where groups of variables begin among the unit's values."""
    names = [variable.name for variable in variables]
    begins = np.cumsum([0, *(len(variable.start) for variable in variables)]).tolist()
    heads = {"DUTY": "duty", "STEER": "steer", "SOIL": f"soil.{next(iter(quantities(Soil)))}", "OUT": "wheel_rate"}
    for head, name in heads.items():
        yield f"#define FIRST_{head} {begins[names.index(name)] if name in names else 0}"
    yield f"#define N_ALL {begins[-1]}"


def _variables(model: Model, kernel: Kernel) -> tuple[list[Variable], list[int]]:
    """Return the variables, and where a row has each output's numbers."""
    wheels, servos = [wheel.name for wheel in model.rover.wheels], len(kernel.servo_wheels)
    order = f"; wheels: {', '.join(wheels)}"
    variables = [Variable("duty", "", "input", (0.0,) * len(wheels), f"duty of each motor{order}", -1.0, 1.0)]
    if servos:
        variables.append(Variable("steer", "rad", "input", (0.0,) * servos, "steering angles, targets of the servos"))
    for (name, spec), value in zip(quantities(Soil).items(), kernel.soils[0].tolist(), strict=True):
        variables.append(
            Variable(f"soil.{name}", spec.unit, "parameter", (value,), f"of the ground: {spec.source}",
                     *np.clip((spec.low, spec.high), -1e300, 1e300).tolist())
        )  # fmt: skip
    row, places = row_type(model), list[int]()

    def out(name: str, unit: str, description: str, of: str, at: Any) -> None:
        assert row.fields is not None
        kind, offset = row.fields[of][:2]
        numbers = np.arange(offset // 8, offset // 8 + kind.itemsize // 8).reshape(kind.shape)[at].ravel().tolist()
        places.extend(numbers)
        variables.append(Variable(name, unit, "output", (0.0,) * len(numbers), description))

    out("wheel_rate", "rad/s", f"rate of each wheel's joint{order}", "v", [wheel.dof for wheel in model.rover.wheels])
    for name, (unit, description) in OF_WHEELS.items():
        out(name, unit, description, "record", (slice(None), RECORD.index(name)))
    joints = suspension_places(model.rover)
    if len(joints):
        out("suspension", "rad", "angles of the suspension's joints, in the rover's order", "q", joints)
    for at, (name, description) in enumerate({"roll": "", "pitch": ", nose down above 0", "yaw": ""}.items()):
        out(name, "rad", f"of the base{description}", "attitude", at)
    out("position", "m", "of the base: x forward at the start, y left, z up", "q", slice(0, 3))
    out("velocity", "m/s", "of the base, in the world", "velocity", ...)
    return variables, places


class _Block:
    """Arrays that share their memory: one array of the C struct."""

    def __init__(self, name: str, array: np.ndarray):
        self.name, self.begin, self.end = name, array.ctypes.data, array.ctypes.data + array.nbytes
        self.kind, dtype = ("integer", np.int64) if array.dtype.kind == "i" else ("double", float)
        self.values = np.frombuffer(array, dtype=dtype)


class _Image:
    """The memory of a drive, written as C: what its structs hold, and what their pointers point at."""

    def __init__(self, kernel: Kernel, loop: Loop, functions: Mapping[str, str]):
        arrays = [*kernel.fixed.keep.values(), *kernel.keep.values(), *loop.keep.values()]
        self.blocks, self.functions = list[_Block](), functions
        for array in sorted(_nonempty_arrays(arrays), key=lambda array: (array.ctypes.data, -array.nbytes)):
            if not self.blocks or array.ctypes.data >= self.blocks[-1].end:
                self.blocks.append(_Block(f"block_{len(self.blocks)}", array))
        self.numbers, self.pointers, self.loop, self.held = list[str](), list[str](), loop, kernel.struct.n_held
        for target, struct, groups in (("drive", kernel.struct, FIELDS), ("loop", loop.struct, LOOP_FIELDS)):
            for name, form in ((name, form) for _, lines, form in groups for names in lines for name in names.split()):
                self._take(f"p->{target}.{name}", name, getattr(struct, name), form)

    def _take(self, target: str, name: str, value: Any, form: str) -> None:
        """Write a field of a struct as a number, a function or a pointer; what stays NULL is left out."""
        if "*" not in form and "function" not in form:
            self.numbers.append(f"  {target} = {c_number(value)};")
        elif name in self.functions and value:
            self.pointers.append(f"  {target} = {self.functions[name]};")
        elif name in SIZED_IN_C:
            self.pointers.append(f"  {target} = {SIZED_IN_C[name]};")
        elif name == "moving":
            addresses = np.asarray(self.loop.keep[name]).tolist()
            places = [place if (place := self._place(address)) != NOWHERE else "p->values" for address in addresses]
            self.pointers += [f"  p->moving[{at}] = {place};" for at, place in enumerate(places)]
            self.pointers.append(f"  {target} = p->moving;")
        elif (place := self._place(value)) != NOWHERE:
            self.pointers.append(f"  {target} = {place};")

    def _place(self, address: int | None) -> str:
        """Return C of an address within a block; that of an empty array is never looked at."""
        block = next((block for block in self.blocks if address and block.begin <= address < block.end), None)
        return f"p->{block.name} + {((address or 0) - block.begin) // 8}" if block else NOWHERE

    @property
    def source(self) -> str:
        """The struct Unit, what fills it, and what binds its pointers."""
        members = [f"  _Alignas(64) {block.kind} {block.name}[{block.values.size}];" for block in self.blocks]
        constant = {block.name: block for block in self.blocks if block.values.any()}
        tables = [c_table(block.kind, f"OF_{name}", block.values.tolist()) for name, block in constant.items()]
        copies = [f"  memcpy(p->{name}, OF_{name}, sizeof OF_{name});" for name in constant]
        room = [f"  _Alignas(64) double held_lanes[MAX_QUESTIONS * {max(self.held, 1)}];"]
        room.append(f"  double *moving[{self.loop.struct.n_moving}], values[N_ALL];")
        return "\n".join(
            [*(f"extern {LAWS[key].format(name)};" for key, name in self.functions.items()), *tables,
             "typedef struct {", "  _Alignas(64) Drive drive;", "  Loop loop;", "  Step step;", *room, *members,
             "} Unit;", "static void unit_fill(Unit *p) {", *self.numbers, *copies, "}",
             "static void unit_bind(Unit *p) {", *self.pointers, "}"]
        )  # fmt: skip


def _nonempty_arrays(values: list[Any]) -> Iterator[np.ndarray]:
    """Yield the arrays that hold anything, in C's order: what the compiled loop works on."""
    return (value for value in values if isinstance(value, np.ndarray) and value.nbytes)
