"""A slip control as a functional mock-up unit: its C, which is also taken away alone, and the unit's around it."""

from __future__ import annotations

import math

from rover_pin.control.embedded.estimates import TABLES
from rover_pin.control.embedded.source import Embedded
from rover_pin.control.fmi.unit import MAIN, FunctionalUnit, Variable

UNIT = """#include "rover_control.h"
#include <string.h>

typedef struct {{
  RoverControl control;
  double values[{all}];
}} Unit;

static void unit_bind(Unit *u) {{ /* to the tables of this process */
  static RoverControl fresh;
  rover_control_reset(&fresh);
  (void)u;
{tables}}}

static void unit_begin(Unit *u) {{ rover_control_reset(&u->control); }}

static const char *unit_step(Unit *u) {{
  RoverReading in;
  RoverCommand out;
  _Static_assert(sizeof in == {inputs} * sizeof(double), "a reading is its numbers, one after another");
  memcpy(&in, u->values, sizeof in);
  rover_control_step(&u->control, &in, &out);
  memcpy(u->values + {inputs}, &out, {outputs} * sizeof(double));
  u->values[{inputs} + {outputs}] = out.stopped;
  return 0;
}}
"""


def controller_unit(taken: Embedded) -> FunctionalUnit:
    """Return the unit of a slip control: a step reads what the rover reads and gives the duties of the next period.

    Stepped before the rover's variable unit, with its outputs of the last step, it is sampled as `simulate` samples it.
    """
    wheels, names = len(taken.rover.wheels), ", ".join(wheel.name for wheel in taken.rover.wheels)
    each, links = (0.0,) * wheels, max(taken.links, 1)
    inputs = (
        Variable("duty_applied", "", "input", each, f"duties now applied; wheels: {names}", -1.0, 1.0),
        Variable("wheel_rate", "rad/s", "input", each, "rates of the wheels' joints"),
        Variable("current", "A", "input", each, "currents of the motors"),
        Variable("suspension", "rad", "input", (0.0,) * links, "angles of the suspension's joints"),
        Variable("roll", "rad", "input", (0.0,), "of the base"),
        Variable("pitch", "rad", "input", (0.0,), "of the base, nose down above 0"),
        Variable("seen_speed", "m/s", "input", (math.nan,), "by visual odometry; NaN: none", may_be_nan=True),
        Variable("slip", "", "input", each, "slip ratios, for a control that does not estimate them"),
        Variable("travel", "m/s", "input", each, "speeds over the ground, likewise"),
    )
    outputs = (
        Variable("duty", "", "output", each, "duties to apply until the next step"),
        Variable("slip_estimate", "", "output", each, "slip ratios as the control takes them"),
        Variable("hole", "m", "output", each, "estimated depth of each wheel's hole"),
        Variable("stands", "", "output", (0.0,), "probability that the rover stands while its wheels turn"),
        Variable("stopped", "", "output", (0.0,), "1 where it is stuck, and all duties stay 0"),
    )
    inputs_count, outputs_count = (sum(len(variable.start) for variable in group) for group in (inputs, outputs))
    bound = TABLES if taken.on_board else ()
    text = UNIT.format(
        all=inputs_count + outputs_count,
        inputs=inputs_count,
        outputs=outputs_count - 1,
        tables="".join(f"  u->control.belief.{name} = fresh.belief.{name};\n" for name in bound),
    )
    sources = {"rover_control.h": taken.header, "rover_control.c": taken.source, MAIN: text}
    return FunctionalUnit(
        "rover_controller",
        f"slip control of {taken.rover.name}, by rover-pin",
        taken.control.period,
        (*inputs, *outputs),
        sources,
    )
