"""A slip control, or held speeds, as a functional mock-up unit: the C of export-c, and the unit's around it."""

import math

from rover_pin.control.embedded.estimates import TABLES
from rover_pin.control.embedded.folder import taken_away
from rover_pin.control.embedded.monitor import NUMBERED
from rover_pin.control.embedded.monitor import TABLES as OF_MONITOR
from rover_pin.control.embedded.motion import EmbeddedMotion
from rover_pin.control.embedded.source import Embedded
from rover_pin.control.fmi.unit import MAIN, FunctionalUnit, Variable
from rover_pin.control.monitor.monitor import CAUSES
from rover_pin.control.monitor.source import HORIZON
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

static void unit_bind(Unit *u) {{ /* to the tables of this process */
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


def unit_of(control: Controller, model: Model) -> FunctionalUnit:
    """Return the unit of a model's slip control, or of its held speeds.

    Stepped before the rover's variable unit, with its outputs of the last step, it is sampled as `simulate` samples it.
    """
    taken = taken_away(control, model)
    if isinstance(taken, EmbeddedMotion):
        (what, variables, counts), tables, stopped = ("held speeds", *_of_motion(taken)), "", ""
    else:
        what, (variables, counts) = "slip control", _of_slip(taken)
        bound = [("control.belief", "fresh.belief", name) for name in TABLES if taken.on_board]
        bound += [("monitor", "fresh_monitor", name) for name in OF_MONITOR if taken.monitor]
        tables = "".join(f"  u->{part}.{name} = {fresh}.{name};\n" for part, fresh, name in bound)
        stopped = f"  answer[{counts[1]}] = out.stopped;\n"
    size = sum(len(variable.start) for variable in variables)
    text = UNIT.format(all=size, inputs=counts[0], outputs=counts[1], tables=tables, stopped=stopped)
    sources = {"rover_control.h": taken.header, "rover_control.c": taken.source, MAIN: text}
    what = f"{what} of {taken.rover.name}, by rover-pin"
    return FunctionalUnit("rover_controller", what, taken.control.period, variables, sources)


UnitVariables = tuple[tuple[Variable, ...], tuple[int, int]]
"""Variables, and how many numbers are those of the C structs of reading and command."""


def _of_motion(taken: EmbeddedMotion) -> UnitVariables:
    """Return the variables of held speeds: a step reads the commanded motion and the wheels' rates."""
    wheels, steered = len(taken.rover.wheels), len(taken.control.angles)
    order = f"; wheels: {', '.join(wheel.name for wheel in taken.rover.wheels)}"
    variables = [
        Variable("speed", "m/s", "input", (0.0,), "of the body, forwards"),
        Variable("yaw_rate", "rad/s", "input", (0.0,), "to the left"),
        Variable("aside", "m/s", "input", (0.0,), "to the left, where the wheels steer"),
        Variable("wheel_rate", "rad/s", "input", (0.0,) * wheels, f"rates of the wheels' joints{order}"),
        Variable("duty", "", "output", (0.0,) * wheels, "duties to apply until the next step"),
    ]
    if steered:
        variables.append(Variable("steer", "rad", "output", (0.0,) * steered, "angles of the wheels that steer"))
    return tuple(variables), (3 + wheels, wheels + steered)


def _of_slip(taken: Embedded) -> UnitVariables:
    """Return the variables of a slip control: a step reads what the rover reads and gives the next period's duties."""
    wheels, names = len(taken.rover.wheels), ", ".join(wheel.name for wheel in taken.rover.wheels)
    per_wheel, links = (0.0,) * wheels, max(taken.links, 1)
    inputs = (
        Variable("duty_applied", "", "input", per_wheel, f"duties now applied; wheels: {names}", -1.0, 1.0),
        Variable("wheel_rate", "rad/s", "input", per_wheel, "rates of the wheels' joints"),
        Variable("current", "A", "input", per_wheel, "currents of the motors"),
        Variable("suspension", "rad", "input", (0.0,) * links, "angles of the suspension's joints"),
        Variable("roll", "rad", "input", (0.0,), "of the base"),
        Variable("pitch", "rad", "input", (0.0,), "of the base, nose down above 0"),
        Variable("seen_speed", "m/s", "input", (math.nan,), "by visual odometry; NaN: none", may_be_nan=True),
        Variable("slip", "", "input", per_wheel, "slip ratios, for a control that does not estimate them"),
        Variable("travel", "m/s", "input", per_wheel, "speeds over the ground, likewise"),
    )
    answers = (
        Variable("duty", "", "output", per_wheel, "duties to apply until the next step"),
        Variable("slip_estimate", "", "output", per_wheel, "slip ratios as the control takes them"),
        Variable("hole", "m", "output", per_wheel, "estimated depth of each wheel's hole"),
        Variable("stands", "", "output", (0.0,), "probability that the rover stands while its wheels turn"),
        Variable("stopped", "", "output", (0.0,), "1 where it is stuck, and all duties stay 0"),
    )
    forecast = (
        Variable("p_stuck", "", "output", (0.0,), f"probability that the rover stands {HORIZON:g} s later"),
        Variable("p_buried", "", "output", (0.0,), "probability that a wheel is buried by then"),
        Variable("alarm", "", "output", (0.0,), "1 while the monitor's alarm is raised"),
        Variable("cause", "", "output", (0.0,), f"{NUMBERED}; -1 none"),
        Variable("p_causes", "", "output", (0.0,) * len(CAUSES), f"probability of each: {', '.join(CAUSES)}"),
    )
    variables = (*inputs, *answers, *(forecast if taken.monitor else ()))
    inputs_count, answers_count = (sum(len(variable.start) for variable in group) for group in (inputs, answers))
    return variables, (inputs_count, answers_count - 1)
