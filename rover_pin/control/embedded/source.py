"""The C of a slip control: header and source, from the same expressions as the package's own loop."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from rover_pin import version
from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import text_of_package
from rover_pin.control.embedded.estimates import belief_struct, kept_inside, of_estimate, of_limit, of_stop
from rover_pin.control.embedded.monitor import monitor_header, monitor_text
from rover_pin.control.monitor import source as monitor_source
from rover_pin.control.monitor.monitor import Monitor
from rover_pin.control.sensing import belief
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.control.slip_control import SlipControl
from rover_pin.control.slip_estimate import TableEstimate
from rover_pin.control.torque_check import TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import c_table

READING = """typedef struct {{ /* what is read at a sample; wheels in the order {names} */
  rover_real duty[ROVER_WHEELS]; /* now applied [-] */
  rover_real wheel_rate[ROVER_WHEELS]; /* of the wheels' joints [rad/s] */
  rover_real current[ROVER_WHEELS]; /* of the motors [A]{current} */
  rover_real suspension[{room}]; /* angles of {links} [rad]{link_use} */
  rover_real roll, pitch; /* of the base [rad]; nose down is above 0 */
  rover_real seen_speed; /* forwards, of visual odometry [m/s]; NaN where there is none{odometry} */
  rover_real slip[ROVER_WHEELS], travel[ROVER_WHEELS]; /* slip and speed over the ground [-, m/s]{slip} */
}} RoverReading;"""
UNUSED = "; not looked at"
COMMAND = """typedef struct {
  rover_real duty[ROVER_WHEELS]; /* to apply until the next sample [-] */
  rover_real slip[ROVER_WHEELS], hole[ROVER_WHEELS]; /* estimates: slip [-], depth of each wheel's hole [m] */
  rover_real stands; /* probability that the rover stands while its wheels turn; 0 where that is not estimated */
  int stopped; /* whether it is stuck, and all duties are 0 from now on */
} RoverCommand;"""
TABLES = {"table": ("between", "signed_speed", "slip_by_table"), "board": ("slip_travel",),
          "limit": ("between", "duty_for"), "stop": ("stops",)}  # fmt: skip


BEGIN = """#include "rover_control.h"
#include <math.h>
#include <string.h>
typedef rover_real real;
#define casadi_real real
#define casadi_int int"""
HEADER = """/* {what} of {name}, by rover-pin {version}: C11 with libm.
   Call rover_control_step every {period:g} s. -DROVER_REAL=float for single precision. */
#ifndef ROVER_CONTROL_H
#define ROVER_CONTROL_H
#ifndef ROVER_REAL
#define ROVER_REAL double
#endif
typedef ROVER_REAL rover_real;
#ifdef __cplusplus
extern "C" {{
#endif
#define ROVER_WHEELS {wheels}
#define ROVER_PERIOD {period!r}
{structs}
void rover_control_reset(RoverControl *control); /* before the first step */
void rover_control_step(RoverControl *control, const RoverReading *reading, RoverCommand *command);
{ahead}#ifdef __cplusplus
}}
#endif
#endif
"""


def c_header(what: str, rover: Rover, period: float, structs: Sequence[str], ahead: Sequence[str] = ()) -> str:
    """Return the C header of a control: its structs, and what else it declares."""
    facts = {"name": rover.name, "version": version.__version__, "period": period, "wheels": len(rover.wheels)}
    more = "".join(f"{line}\n" for line in ahead)
    return HEADER.format(what=what, **facts, structs="\n".join(structs), ahead=more)


@dataclass(frozen=True)
class Embedded:
    """A slip control to take away, of a rover; an on-board one with the monitor that reads the same belief."""

    control: SlipControl
    rover: Rover
    stop: StopStuck | None = None
    monitor: Monitor | None = None

    @property
    def controller(self) -> SlipControl | StopStuck:
        """The control, with the stop that it may have."""
        return self.stop or self.control

    @property
    def on_board(self) -> OnboardSlip | None:
        """The on-board estimate, where the control has it."""
        return self.control.estimate if isinstance(self.control.estimate, OnboardSlip) else None

    @property
    def links(self) -> int:
        """How many suspension angles are read."""
        return len(self.on_board.places) if self.on_board else 0

    @property
    def reads_sensors_alone(self) -> bool:
        """Whether it estimates the slip itself."""
        return self.on_board is not None or isinstance(self.control.estimate, TableEstimate)

    @cached_property
    def expressions(self) -> list[ca.Function]:
        """The CasADi functions that it computes."""
        of_monitor = monitor_source.expressions(self.monitor.law) if self.monitor else ()
        return [self.control.expression, *(self.on_board.expressions if self.on_board else ()), *of_monitor]

    @cached_property
    def header(self) -> str:
        """The C header."""
        wheels = ", ".join(wheel.name for wheel in self.rover.wheels)
        on_board = self.on_board
        reading = READING.format(
            names=wheels,
            room="ROVER_LINKS" if self.links else "1",
            links="the suspension's joints",
            current="" if on_board else UNUSED,
            link_use="" if on_board else UNUSED,
            odometry="" if on_board and on_board.odometry else UNUSED,
            slip=UNUSED if on_board or isinstance(self.control.estimate, TableEstimate) else "",
        )
        belief = [belief_struct(on_board)] if on_board else []
        memory = ["typedef struct { /* what is remembered; its fields are private */"]
        memory += ["  rover_real integral[ROVER_WHEELS], depth[ROVER_WHEELS], late_share;", "  int stopped;"]
        memory += [*(["  RoverBelief belief;"] if on_board else []), "} RoverControl;"]
        structs = [f"#define ROVER_LINKS {self.links}", *belief, reading, COMMAND, *memory]
        ahead = monitor_header(self.monitor) if self.monitor else ()
        return c_header("Slip control", self.rover, self.control.period, structs, ahead)

    @cached_property
    def source(self) -> str:
        """The C source."""
        on_board, control = self.on_board, self.control
        needed = [*(TABLES["table"] if isinstance(control.estimate, TableEstimate) else ())]
        needed += TABLES["board"] if on_board else ()
        needed += TABLES["stop"] if self.stop else ()
        needed += TABLES["limit"] if isinstance(control.limit, TorqueLimit) else ()
        lines = [
            BEGIN,
            "typedef int integer;",
            _tables(needed),
            casadi_functions(self.expressions),
            c_table("real", "GAINS", list(map(float, control.gains.values().values()))),
        ]
        if on_board:
            lines += [
                belief.constants(),
                "typedef RoverBelief Belief;",
                "#define LANES 1",
                "typedef void (*lanes_law)(const real *, const real *, real *);",
            ]
            lines += [_one_lane(law.name()) for law in on_board.expressions[1:]]
            lines += [_belief()]
        lines += [of_estimate(control), of_limit(control.limit), of_stop(self.stop)]
        lines += [text_of_package("rover_pin.control.embedded", "controller.c")]
        return "\n".join([*lines, *(monitor_text(self.monitor) if self.monitor else ())])


def embed(controller: Controller, model: Model) -> Embedded:
    """Return a controller of a model's rover as it can be taken away.

    Raises ParameterError: a controller that is no slip control, or one with parts of its user's own.
    """
    stop = controller if isinstance(controller, StopStuck) else None
    control = stop.controller if stop else controller
    if not isinstance(control, SlipControl):
        raise ParameterError(
            "Only a slip control can be taken away: choose control = eq9, onboard, camera or true (the slip is then "
            "given with each reading); cmd-vel with export-c."
        )
    on_board = control.estimate if isinstance(control.estimate, OnboardSlip) else None
    return Embedded(control, model.rover, stop, Monitor.of(model, on_board) if on_board else None)


def _tables(needed: Sequence[str]) -> str:
    """Return the functions of `tables.c` that are needed: an unused one is a warning."""
    parts = text_of_package("rover_pin.simulation.native", "tables.c").split("\n\n")
    used = [part for part in parts if any(re.search(rf"static \w+ {name}\(", part) for name in needed)]
    return "\n\n".join([*(part for part in parts if part.startswith("#define") and needed), *used])


def _belief() -> str:
    return kept_inside(belief.c_source())


def casadi_functions(expressions: Sequence[ca.Function]) -> str:
    """Return CasADi's C of the functions, static and by their names, with its own helpers and nothing else."""
    generator = ca.CodeGenerator("laws.c", {"with_header": False, "with_export": False})
    for function in expressions:
        generator.add(function)
    text = str(generator.dump())
    helpers = re.findall(r"^casadi_real casadi_\w+\([^)]*\) \{.*?\}$", text, re.MULTILINE | re.DOTALL)
    bodies = re.findall(r"^static int (casadi_f\d+)(\(.*?^\})", text, re.MULTILINE | re.DOTALL)
    names = re.findall(r"^int (\w+)\(const casadi_real\*\* arg.*?\{\s*return (casadi_f\d+)\(", text, re.MULTILINE)
    called = {inner: outer for outer, inner in names}
    return "\n\n".join(
        [*(f"static {helper}" for helper in helpers), *(f"static int {called[name]}{body}" for name, body in bodies)]
    )


def _one_lane(name: str) -> str:
    """Return a law as `belief.c` calls it, for one particle."""
    return (
        f"static void {name}_lane(const real *of, const real *shared, real *result) {{\n"
        "  const real *arguments[2] = {of, shared};\n  real *results[1] = {result};\n"
        f"  {name}(arguments, results, 0, 0, 0);\n}}\n#define {name} {name}_lane"
    )
