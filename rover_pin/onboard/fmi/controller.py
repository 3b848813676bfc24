"""A control as a functional mock-up unit (FMU): the C code that `export-c` writes, within the C code of a unit."""

import math

from rover_pin.onboard.embedded.folder import control_export
from rover_pin.onboard.embedded.motion import EmbeddedMotion
from rover_pin.onboard.embedded.parts import BELIEF_TABLES, MONITOR_TABLES, NUMBERED_CAUSES
from rover_pin.onboard.fmi.unit import MAIN, FunctionalUnit, Variable
from rover_pin.onboard.monitor.monitor import CAUSES
from rover_pin.onboard.monitor.source import HORIZON
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model

UNIT = """#include "rover_control.h"
#include <string.h>

typedef struct {{
  RoverControl control;
#ifdef ROVER_MONITOR
  RoverMonitor monitor;
#endif
  double values[{all}];
}} Unit;

/* Let the pointers of the unit point to the constant tables of this process. A state that another process has saved has
   other addresses. */
static void unit_bind(Unit *u) {{
  static RoverControl fresh;
  rover_control_reset(&fresh);
  (void)u;
#ifdef ROVER_MONITOR
  static RoverMonitor fresh_monitor;
  rover_monitor_reset(&fresh_monitor);
#endif
{tables}}}

static void unit_begin(Unit *u) {{
  rover_control_reset(&u->control);
#ifdef ROVER_MONITOR
  rover_monitor_reset(&u->monitor);
#endif
}}

static const char *unit_step(Unit *u) {{
  RoverReading in;
  RoverCommand out;
  _Static_assert(sizeof in == {inputs} * sizeof(double), "a reading is its numbers, one after another");
  memcpy(&in, u->values, sizeof in);
  rover_control_step(&u->control, &in, &out);
  double *answer = u->values + {inputs};
  memcpy(answer, &out, {outputs} * sizeof(double));
{stopped}#ifdef ROVER_MONITOR
  RoverForecast ahead;
  rover_monitor_step(&u->monitor, &u->control, &in, &ahead);
  const double forecast[4] = {{ahead.p_stuck, ahead.p_buried, ahead.alarm, ahead.cause}};
  memcpy(answer + {outputs} + 1, forecast, sizeof forecast);
  memcpy(answer + {outputs} + 5, ahead.causes, sizeof ahead.causes);
#endif
  return 0;
}}
"""
"""C code of the functions that every unit must define for `fmi3.c`: set the pointers, begin, and take one step."""


def unit_of(control: Controller, model: Model) -> FunctionalUnit:
    """Return the functional mock-up unit of a control for a model's rover: a slip control, or held speeds.

    A co-simulation should step this unit before the rover's unit (`plant`), with the outputs of the rover's last step
    as its inputs. The control is then sampled in the order of `simulate`.

    Raises ParameterError: the control is of another kind, or has parts that cannot be exported.
    """
    export = control_export(control, model)
    if isinstance(export, EmbeddedMotion):
        # The variables have the order of the fields in the C structs RoverReading and RoverCommand: the commanded
        # motion and the rates of the wheels, then duties and steering angles.
        what, tables, stopped = "held speeds", "", ""
        wheels, steered = len(export.rover.wheels), len(export.control.angles)
        order = f"; wheels: {', '.join(wheel.name for wheel in export.rover.wheels)}"
        variables: tuple[Variable, ...] = (
            Variable("speed", "m/s", "input", (0.0,), "commanded speed of the body, forwards"),
            Variable("yaw_rate", "rad/s", "input", (0.0,), "commanded yaw rate, to the left"),
            Variable("aside", "m/s", "input", (0.0,), "commanded speed sideways, to the left; for wheels that steer"),
            Variable("wheel_rate", "rad/s", "input", (0.0,) * wheels, f"rates of the wheel joints{order}"),
            Variable("duty", "", "output", (0.0,) * wheels, "duties to apply until the next step"),
        )
        if steered:
            angles = Variable("steer", "rad", "output", (0.0,) * steered, "angles of the wheels that steer")
            variables = (*variables, angles)
        counts = (3 + wheels, wheels + steered)
    else:
        # The inputs are the rover's readings, and the outputs are duties and estimates. They have the order of the
        # fields in the C structs, because their values are copied as one block of memory.
        what = "slip control"
        wheels, names = len(export.rover.wheels), ", ".join(wheel.name for wheel in export.rover.wheels)
        per_wheel, links = (0.0,) * wheels, max(export.links, 1)
        inputs = (
            Variable(
                "duty_applied", "", "input", per_wheel, f"duties that are applied now; wheels: {names}", -1.0, 1.0
            ),
            Variable("wheel_rate", "rad/s", "input", per_wheel, "rates of the wheel joints"),
            Variable("current", "A", "input", per_wheel, "motor currents"),
            Variable("suspension", "rad", "input", (0.0,) * links, "angles of the suspension joints"),
            Variable("roll", "rad", "input", (0.0,), "roll of the base"),
            Variable("pitch", "rad", "input", (0.0,), "pitch of the base, positive with the nose down"),
            Variable(
                "seen_speed", "m/s", "input", (math.nan,), "speed by visual odometry; NaN if none", may_be_nan=True
            ),
            Variable("slip", "", "input", per_wheel, "slip ratios, for a control that does not estimate them"),
            Variable(
                "travel",
                "m/s",
                "input",
                per_wheel,
                "speeds over the ground, for a control that does not estimate slip ratios",
            ),
        )
        answers = (
            Variable("duty", "", "output", per_wheel, "duties to apply until the next step"),
            Variable("slip_estimate", "", "output", per_wheel, "slip ratios that the control uses"),
            Variable("hole", "m", "output", per_wheel, "estimated depth of each wheel's hole"),
            Variable("stands", "", "output", (0.0,), "probability that the rover does not move while its wheels turn"),
            Variable("stopped", "", "output", (0.0,), "1 if the rover is stuck and all duties stay 0"),
        )
        forecast = (
            Variable("p_stuck", "", "output", (0.0,), f"probability that the rover is stuck {HORIZON:g} s later"),
            Variable("p_buried", "", "output", (0.0,), f"probability that a wheel is buried {HORIZON:g} s later"),
            Variable("alarm", "", "output", (0.0,), "1 while the monitor's alarm is raised"),
            Variable("cause", "", "output", (0.0,), f"{NUMBERED_CAUSES}; -1 none"),
            Variable("p_causes", "", "output", (0.0,) * len(CAUSES), f"probability of each cause: {', '.join(CAUSES)}"),
        )
        variables = (*inputs, *answers, *(forecast if export.monitor else ()))
        # `stopped` is not counted, because it is an integer in C and is copied on its own.
        inputs_count, answers_count = (sum(len(variable.start) for variable in group) for group in (inputs, answers))
        counts = (inputs_count, answers_count - 1)
        bound = [("control.belief", "fresh.belief", name) for name in BELIEF_TABLES if export.on_board]
        bound += [("monitor", "fresh_monitor", name) for name in MONITOR_TABLES if export.monitor]
        tables = "".join(f"  u->{part}.{name} = {fresh}.{name};\n" for part, fresh, name in bound)
        stopped = f"  answer[{counts[1]}] = out.stopped;\n"
    # C copies a reading and a command as one block of memory each; `stopped` is the only value that is an integer in C.
    size = sum(len(variable.start) for variable in variables)
    text = UNIT.format(all=size, inputs=counts[0], outputs=counts[1], tables=tables, stopped=stopped)
    sources = {"rover_control.h": export.header, "rover_control.c": export.source, MAIN: text}
    what = f"{what} of {export.rover.name}, by rover-pin"
    return FunctionalUnit("rover_controller", what, export.control.period, variables, sources)
