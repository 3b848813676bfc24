"""A rover on its ground as a functional mock-up unit (FMU): the compiled simulation, with its memory as C code.

A drive of the compiled simulation is a set of C structs with pointers to NumPy arrays. Here these structs and arrays
become one C struct, which is filled with the values that they have after the rover has been set down.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil
from rover_pin.onboard.fmi.unit import MAIN, FunctionalUnit, Variable
from rover_pin.simulation.compiled.generated_laws import laws_source, structure_of
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native import source
from rover_pin.simulation.native.compiled_body import body_source
from rover_pin.simulation.native.loop import Loop
from rover_pin.simulation.native.shared import FIELDS, LOOP_FIELDS, RECORD, c_number, c_table
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.start import Start
from rover_pin.simulation.state import suspension_places
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.trace.record import row_type

WHEEL_OUTPUTS = {
    "current": ("A", "current of each motor"),
    "torque": ("N m", "torque of each motor at the wheel"),
    "slip": ("", "slip ratio of each wheel, Eq (1); only a simulator knows it"),
    "sinkage": ("m", "sinkage of each wheel"),
    "normal": ("N", "normal force of each wheel"),
    "travel": ("m/s", "speed of each wheel's centre over the ground"),
}
"""Unit of measurement and description of those outputs of the unit that are taken from a wheel's record of a step, by
the field of the record."""
UNLIMITED_STEPS = 2**62
"""Number of steps after which the compiled simulation would end a drive. It is so large that only the co-simulation
decides when the drive ends."""
NO_ADDRESS = "0"
"""C code of the pointer to an array that does not exist or is empty."""
SIZED_IN_C = {"step": "&p->step", "held_lanes": "p->held_lanes"}
"""C code of arrays whose size depends on the processor that runs the unit, by the name of the pointer in the struct."""
SCALAR = "int {}(const double **, double **, integer *, double *, int)"
OVER_LANES = "void {}(const double *, const double *, const double *, double *)"
LAWS = {"rigid_body": SCALAR, "contact_before": SCALAR, "contact_law": OVER_LANES, "motor_law": OVER_LANES,
        "body_law": SCALAR}  # fmt: skip
"""C prototypes of the laws, by the name of the function pointer in the struct Drive. SCALAR is the prototype that
CasADi generates, and OVER_LANES the prototype of a law that is evaluated in SIMD lanes."""


def plant(model: Model, start: Start = Start(), timing: Timing = Timing()) -> FunctionalUnit:
    """Return the functional mock-up unit of a model's rover on its ground. The rover is set down at rest at `start`.

    A step of the unit takes one control period. During a step, duties and steering targets are constant, and the
    outputs are the readings at the end of the step. The soil's constants are parameters, which may change at any time.
    The results equal the results of `simulate`, except for the rounding of another compiler's elementary functions.

    Parameters
    ----------
    model : Model
        Rover, ground, soil and motors.
    start : Start
        Position and heading at which the rover is set down.
    timing : Timing
        Time step and control period [s].

    Raises
    ------
    SimulationError
        The rover cannot be set down at `start`.
    """
    drive = set_out(model, lambda reading: 0.0, timing.control, start, timing)
    kernel, period = drive.stepper, round(drive.timing.control / drive.timing.dt)
    assert isinstance(kernel, Kernel)
    loop = Loop(kernel, drive.timing.dt, period, period, per_control=period)
    loop.struct.steps = UNLIMITED_STEPS
    # The variables of the unit, and the position of each output number in a row of the trace (`places`).
    rover, servos = drive.model.rover, len(kernel.servo_wheels)
    wheels = [wheel.name for wheel in rover.wheels]
    order = f"; wheels: {', '.join(wheels)}"
    variables = [Variable("duty", "", "input", (0.0,) * len(wheels), f"duty of each motor{order}", -1.0, 1.0)]
    if servos:
        variables.append(Variable("steer", "rad", "input", (0.0,) * servos, "steering angles, targets of the servos"))
    for (name, spec), value in zip(quantities(Soil).items(), kernel.soils[0].tolist(), strict=True):
        variables.append(
            Variable(f"soil.{name}", spec.unit, "parameter", (value,), f"soil constant; default from {spec.source}",
                     *np.clip((spec.low, spec.high), -1e300, 1e300).tolist())
        )  # fmt: skip
    row, places = row_type(drive.model), list[int]()

    def out(name: str, unit: str, description: str, field: str, index: Any) -> None:
        """Add an output to the variables: the entries `index` of the field `field` in a row of the trace."""
        # A row consists of numbers of 8 bytes, so that the offset in bytes gives the index of a number.
        assert row.fields is not None
        kind, offset = row.fields[field][:2]
        numbers = np.arange(offset // 8, offset // 8 + kind.itemsize // 8).reshape(kind.shape)[index].ravel().tolist()
        places.extend(numbers)
        variables.append(Variable(name, unit, "output", (0.0,) * len(numbers), description))

    out("wheel_rate", "rad/s", f"rate of each wheel joint{order}", "v", [wheel.dof for wheel in rover.wheels])
    for name, (unit, description) in WHEEL_OUTPUTS.items():
        out(name, unit, description, "record", (slice(None), RECORD.index(name)))
    joints = suspension_places(rover)
    if len(joints):
        out("suspension", "rad", "angles of the suspension joints, in the order of the rover's joints", "q", joints)
    for axis, (name, remark) in enumerate({"roll": "", "pitch": ", positive with the nose down", "yaw": ""}.items()):
        out(name, "rad", f"{name} of the base{remark}", "attitude", axis)
    out("position", "m", "position of the base in the world; z points up", "q", slice(0, 3))
    out("velocity", "m/s", "velocity of the base in the axes of the world", "velocity", ...)
    # Where groups of variables begin among the values of the unit; `plant.c` copies each group as one block.
    names = [variable.name for variable in variables]
    begins = np.cumsum([0, *(len(variable.start) for variable in variables)]).tolist()
    heads = {"DUTY": "duty", "STEER": "steer", "SOIL": f"soil.{next(iter(quantities(Soil)))}", "OUT": "wheel_rate"}
    firsts = [
        f"#define FIRST_{head} {begins[names.index(name)] if name in names else 0}" for head, name in heads.items()
    ]
    laws, (body, body_name) = laws_source(structure_of(drive.model)), body_source(model.rover.model)
    functions = dict(zip(LAWS, (body_name, *laws.names), strict=False))
    lines = [source(), *firsts, f"#define N_ALL {begins[-1]}", c_table("int", "ROW_PLACES", places)]
    lines += [f"#define N_OUT {len(places)}", _Image(kernel, loop, functions).source]
    lines += [text_of_package("rover_pin.onboard.fmi", "plant.c")]
    return FunctionalUnit(
        "rover_plant",
        f"{model.rover.name} on its ground, by rover-pin",
        timing.control,
        tuple(variables),
        {MAIN: "\n".join(lines), "laws.c": laws.text, "rigid_body.c": body},
    )


class _MemoryBlock:
    """A block of memory that one NumPy array occupies, or several arrays that share memory. It becomes one array in the
    C struct of the unit.
    """

    def __init__(self, name: str, array: np.ndarray):
        self.name, self.begin, self.end = name, array.ctypes.data, array.ctypes.data + array.nbytes
        self.kind, dtype = ("integer", np.int64) if array.dtype.kind == "i" else ("double", float)
        self.values = np.frombuffer(array, dtype=dtype)


class _Image:
    """The memory of a drive as C code: the fields of its structs, and the arrays behind their pointers.

    `functions` are the names of the C functions behind the function pointers of the struct, by the name of the pointer.
    """

    def __init__(self, kernel: Kernel, loop: Loop, functions: Mapping[str, str]):
        arrays = [*kernel.fixed.keep.values(), *kernel.keep.values(), *loop.keep.values()]
        self.blocks, self.functions = list[_MemoryBlock](), functions
        # Views into one array share its memory, and must do so in C too, where one function writes what another reads.
        nonempty = (array for array in arrays if isinstance(array, np.ndarray) and array.nbytes)
        for array in sorted(nonempty, key=lambda array: (array.ctypes.data, -array.nbytes)):
            if not self.blocks or array.ctypes.data >= self.blocks[-1].end:
                self.blocks.append(_MemoryBlock(f"block_{len(self.blocks)}", array))
        self.numbers, self.pointers, self.loop, self.held = list[str](), list[str](), loop, kernel.struct.n_held
        for target, struct, groups in (("drive", kernel.struct, FIELDS), ("loop", loop.struct, LOOP_FIELDS)):
            for name, form in ((name, form) for _, lines, form in groups for names in lines for name in names.split()):
                # One C line sets a field of the struct to its value, which is a number, a function or a pointer. A NULL
                # pointer needs no line, because the memory is initially 0.
                field, value = f"p->{target}.{name}", getattr(struct, name)
                if "*" not in form and "function" not in form:
                    self.numbers.append(f"  {field} = {c_number(value)};")
                elif name in self.functions and value:
                    self.pointers.append(f"  {field} = {self.functions[name]};")
                elif name in SIZED_IN_C:
                    self.pointers.append(f"  {field} = {SIZED_IN_C[name]};")
                elif name == "moving":
                    # An array of pointers: each element is an address in a block of memory.
                    for i, address in enumerate(np.asarray(self.loop.keep[name]).tolist()):
                        place = self._c_address(address)
                        self.pointers.append(f"  p->moving[{i}] = {place if place != NO_ADDRESS else 'p->values'};")
                    self.pointers.append(f"  {field} = p->moving;")
                elif (place := self._c_address(value)) != NO_ADDRESS:
                    self.pointers.append(f"  {field} = {place};")

    def _c_address(self, address: int | None) -> str:
        """Return the C code of an address within a block of memory, or `NO_ADDRESS` for the address of an empty
        array.
        """
        block = next((block for block in self.blocks if address and block.begin <= address < block.end), None)
        return f"p->{block.name} + {((address or 0) - block.begin) // 8}" if block else NO_ADDRESS

    @property
    def source(self) -> str:
        """The C code of the type `Unit`, and of the functions that set its numbers (`unit_fill`) and its pointers
        (`unit_bind`).
        """
        # Memory begins as 0, so that only blocks with other values need a table of constants to copy.
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
