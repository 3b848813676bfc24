"""A slip control as C: its header and source, generated from the CasADi expressions that the simulation evaluates too.

`parts.py` writes the parts that differ from control to control, `vectors.py` the test vectors, and `folder.py` the
folder with all files.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from rover_pin import version
from rover_pin.base.encode import c_comment
from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import text_of_package
from rover_pin.control.sensing import belief
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.control.slip_control import SlipControl
from rover_pin.control.slip_estimate import TableEstimate
from rover_pin.control.torque_check import TorqueLimit
from rover_pin.onboard.embedded.parts import (
    belief_struct,
    estimate_code,
    limit_code,
    monitor_header,
    monitor_text,
    stop_code,
    with_static_functions,
)
from rover_pin.onboard.monitor import source as monitor_source
from rover_pin.onboard.monitor.monitor import Monitor
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import c_table

READING = """typedef struct {{ /* readings of one sample; wheels in the order {names} */
  rover_real duty[ROVER_WHEELS]; /* duties that are applied now [-] */
  rover_real wheel_rate[ROVER_WHEELS]; /* rates of the wheel joints [rad/s] */
  rover_real current[ROVER_WHEELS]; /* motor currents [A]{current} */
  rover_real suspension[{room}]; /* angles of {links} [rad]{link_use} */
  rover_real roll, pitch; /* roll and pitch of the base [rad]; pitch is positive with the nose down */
  rover_real seen_speed; /* forward speed by visual odometry [m/s]; NaN if there is none{odometry} */
  rover_real slip[ROVER_WHEELS], travel[ROVER_WHEELS]; /* slip [-] and speed over the ground [m/s]{slip} */
}} RoverReading;"""
"""C declaration of the struct with the readings that the user's program gives to the control at every sample."""
UNUSED = "; not used"
"""Remark in the C declaration next to a reading that the exported control does not use."""
COMMAND = """typedef struct {
  rover_real duty[ROVER_WHEELS]; /* duties to apply until the next sample [-] */
  rover_real slip[ROVER_WHEELS], hole[ROVER_WHEELS]; /* estimated slip [-] and depth of the hole [m] of each wheel */
  rover_real stands; /* probability that the rover does not move while its wheels turn; 0 if it is not estimated */
  int stopped; /* 1 if the rover is stuck; all duties are then 0 until the control is reset */
} RoverCommand;"""
"""C declaration of the struct with the duties and estimates that the control returns at every sample."""
TABLES = {"table": ("between", "signed_speed", "slip_by_table"), "board": ("slip_travel",),
          "limit": ("between", "duty_for"), "stop": ("stops",)}  # fmt: skip
"""Names of the functions of `tables.c` that the C code of an exported control calls, by the part of the control: the
table of speeds for the slip estimate of Eq (9), the on-board estimate, the torque limit, and the stop of a stuck rover.
"""

BEGIN = """#include "rover_control.h"
#include <math.h>
#include <string.h>
typedef rover_real real;
#define casadi_real real
#define casadi_int int"""
"""First lines of the C source of an exported control."""
HEADER = """/* {what} of {name}, by rover-pin {version}: C11 with libm.
   Call rover_control_step every {period:g} s. Compile with -DROVER_REAL=float for single precision. */
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
"""Text of the C header of an exported control. Its first line names the control and the rover."""
ONE_LANE = """static void {name}_lane(const real *of, const real *shared, real *result) {{
  const real *arguments[2] = {{of, shared}};
  real *results[1] = {{result}};
  {name}(arguments, results, 0, 0, 0);
}}
#define {name} {name}_lane"""
"""C function that calls a CasADi function for one particle, in the form of the laws of `belief.c`."""


def c_header(what: str, rover: Rover, period: float, structs: Sequence[str], ahead: Sequence[str] = ()) -> str:
    """Return the C header of an exported control for a rover.

    Parameters
    ----------
    what : str
        Name of the kind of control, for the comment in the first line.
    rover : Rover
        The rover; the header states the number of its wheels.
    period : float
        Time between two samples [s].
    structs : sequence of str
        C declarations of the structs.
    ahead : sequence of str
        Further lines of declarations, for the monitor.
    """
    return HEADER.format(
        what=what,
        name=c_comment(rover.name),
        version=version.__version__,
        period=period,
        wheels=len(rover.wheels),
        structs="\n".join(structs),
        ahead="".join(f"{line}\n" for line in ahead),
    )


@dataclass(frozen=True)
class EmbeddedControl:
    """The export of a slip control as C: its header, its source, and the expressions that the source evaluates.

    If the control estimates the slip on board, the export includes the monitor, which reads the particles of the
    estimate.
    """

    control: SlipControl
    rover: Rover
    stop: StopStuck | None = None
    """stop of a stuck rover, or None"""
    monitor: Monitor | None = None
    """monitor that warns of a stuck or buried rover, or None if the control does not estimate the slip on board"""

    @property
    def controller(self) -> SlipControl | StopStuck:
        """The controller that a simulation uses: the slip control, or, if the export has a stop, the stop that contains
        the slip control.
        """
        return self.stop or self.control

    @property
    def on_board(self) -> OnboardSlip | None:
        """The on-board slip estimate of the control, or None if the control has another slip estimate."""
        return self.control.estimate if isinstance(self.control.estimate, OnboardSlip) else None

    @property
    def links(self) -> int:
        """Number of suspension angles that the control reads; 0 if it does not estimate the slip on board."""
        return len(self.on_board.places) if self.on_board else 0

    @property
    def reads_sensors_alone(self) -> bool:
        """Whether the control estimates the slip from its readings, so that the user need not give a slip."""
        return self.on_board is not None or isinstance(self.control.estimate, TableEstimate)

    @cached_property
    def expressions(self) -> list[ca.Function]:
        """The CasADi functions that the C code evaluates, for the PI law, the slip estimate and the monitor."""
        of_monitor = monitor_source.expressions(self.monitor.law) if self.monitor else ()
        return [self.control.expression, *(self.on_board.expressions if self.on_board else ()), *of_monitor]

    @cached_property
    def header(self) -> str:
        """The text of the C header of the exported control."""
        wheels = c_comment(", ".join(wheel.name for wheel in self.rover.wheels))
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
        memory = ["typedef struct { /* memory of the control; its fields are private */"]
        memory += ["  rover_real integral[ROVER_WHEELS], depth[ROVER_WHEELS], late_share;", "  int stopped;"]
        memory += [*(["  RoverBelief belief;"] if on_board else []), "} RoverControl;"]
        structs = [f"#define ROVER_LINKS {self.links}", *belief, reading, COMMAND, *memory]
        ahead = monitor_header(self.monitor) if self.monitor else ()
        return c_header("Slip control", self.rover, self.control.period, structs, ahead)

    @cached_property
    def source(self) -> str:
        """The text of the C source of the exported control."""
        on_board, control = self.on_board, self.control
        needed = [*(TABLES["table"] if isinstance(control.estimate, TableEstimate) else ())]
        needed += TABLES["board"] if on_board else ()
        needed += TABLES["stop"] if self.stop else ()
        needed += TABLES["limit"] if isinstance(control.limit, TorqueLimit) else ()
        # Only the functions of `tables.c` that are called, since an unused static function is a compiler warning.
        parts = text_of_package("rover_pin.simulation.native", "tables.c").split("\n\n")
        used = [part for part in parts if any(re.search(rf"static \w+ {name}\(", part) for name in needed)]
        definitions = [part for part in parts if part.startswith("#define") and needed]
        lines = [
            BEGIN,
            "typedef int integer;",
            "\n\n".join([*definitions, *used]),
            casadi_functions(self.expressions),
            c_table("real", "GAINS", list(map(float, control.gains.values().values()))),
        ]
        if on_board:
            # `belief.c` evaluates a law for LANES particles at once. Here it is one particle, so that no SIMD is
            # needed.
            lines += [
                belief.constants(),
                "typedef RoverBelief Belief;",
                "#define LANES 1",
                "typedef void (*lanes_law)(const real *, const real *, real *);",
            ]
            lines += [ONE_LANE.format(name=law.name()) for law in on_board.expressions[1:]]
            lines += [with_static_functions(belief.c_source())]
        lines += [estimate_code(control), limit_code(control.limit), stop_code(self.stop)]
        lines += [text_of_package("rover_pin.onboard.embedded", "controller.c")]
        return "\n".join([*lines, *(monitor_text(self.monitor) if self.monitor else ())])


def embed(controller: Controller, model: Model) -> EmbeddedControl:
    """Return the export of a slip control as C, for the rover of a model.

    Raises ParameterError: the controller is no slip control. `EmbeddedControl.source` also raises this error if the
    slip estimate or the torque limit is a class that a user has written in Python.
    """
    # A stop contains the slip control; a control with an on-board slip estimate also gets the monitor.
    stop = controller if isinstance(controller, StopStuck) else None
    control = stop.controller if stop else controller
    if not isinstance(control, SlipControl):
        raise ParameterError(
            "Only a slip control or cmd-vel can be exported. Choose control = eq9, onboard, camera, true or cmd-vel. "
            "With control = true, your program gives the slip with each reading."
        )
    on_board = control.estimate if isinstance(control.estimate, OnboardSlip) else None
    # The monitor believes in the soil of the slip estimate. The soil of the simulated rover is unknown on board.
    believed = on_board.believed.model if on_board and on_board.believed else model
    return EmbeddedControl(control, model.rover, stop, Monitor.of(believed, on_board) if on_board else None)


def casadi_functions(expressions: Sequence[ca.Function]) -> str:
    """Return the C code of CasADi functions as static C functions of these names, with the helper functions that they
    call.

    CasADi generates each function as `casadi_f0` and a public wrapper around it. Only the body is kept, under the name
    of the wrapper, because all other C code that CasADi writes (sparsity, work sizes, reference counts) is unused here.
    """
    # The generated text is searched for three kinds of functions: helpers, bodies, and the public wrappers.
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
