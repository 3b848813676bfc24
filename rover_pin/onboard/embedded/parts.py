"""C code of the parts of an exported slip control that differ from control to control: slip estimate, torque limit,
stop of a stuck rover, and monitor.

`controller.c` calls the first three parts as the functions `begin`, `estimate`, `highest` and `stop`. The monitor reads
the particles of the slip estimate after each step of the control.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.control.sensing.belief import FIELDS, PARTICLES, row_lengths
from rover_pin.control.sensing.onboard_slip import BACKWARDS_DUTY, OnboardSlip
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.control.slip_control import SlipControl
from rover_pin.control.slip_estimate import TableEstimate, TrueSlip
from rover_pin.control.torque_check import CUSTOM_LIMIT, NoLimit, TorqueLimit, native_limit
from rover_pin.onboard.monitor import source as monitor_source
from rover_pin.onboard.monitor.monitor import CANNOT_TELL, CAUSES, Monitor
from rover_pin.simulation.native.shared import c_table

BELIEF_TABLES = {"radius": "RADIUS", "factors": "FACTORS", "greatest": "GREATEST", "softness": "SOFTNESS"}
"""Names of the constant C tables behind pointers in the C struct Belief, by the field of the struct."""


GIVEN_SLIP = """static void estimate(RoverControl *c, const RoverReading *in, RoverCommand *out, real *travel) {
  (void)c;
  memcpy(out->slip, in->slip, sizeof in->slip);
  memcpy(travel, in->travel, sizeof in->travel);
  out->stands = 0.0;
}
static void begin(RoverControl *c) { (void)c; }
"""
"""C functions `begin` and `estimate` of a control that does not estimate slips: the user's program gives the slips and
travel speeds with each reading."""


def _table_estimate(estimate: TableEstimate) -> str:
    """Return the C functions `begin` and `estimate` of the slip estimate by Eq (9), which computes the slip and travel
    speed of each wheel from its duty and its rate.
    """
    duty, speed = estimate.table.duty, estimate.table.speed
    return f"""{c_table("real", "TABLE_DUTY", duty)}
{c_table("real", "TABLE_SPEED", speed)}

static void estimate(RoverControl *c, const RoverReading *in, RoverCommand *out, real *travel) {{
  int i;
  (void)c;
  for (i = 0; i < ROVER_WHEELS; ++i) {{
    travel[i] = signed_speed(in->duty[i], TABLE_DUTY, TABLE_SPEED, {len(duty)});
    out->slip[i] = slip_by_table({estimate.r!r}, in->wheel_rate[i], travel[i]);
  }}
  out->stands = 0.0;
}}
static void begin(RoverControl *c) {{ (void)c; }}
"""


def _onboard_estimate(estimate: OnboardSlip, radius: float) -> str:
    """Return the C functions `begin` and `estimate` of the on-board slip estimate: `begin` sets up its particle filter,
    and `estimate` updates it.

    The travel speed of a wheel follows from its slip and its rate by Eq (1), with the wheel radius `radius` [m].
    """
    wheels, links = len(estimate.rover.wheels), len(estimate.places)
    belief = estimate.belief.numbers
    # `begin` sets the constants of the filter and the pointers to its tables, `estimate` gives it one sample.
    counts = estimate.belief.struct
    settings = {"n": wheels, "N": PARTICLES, "n_soils": int(counts.n_soils)}
    settings |= {"n_posture": 2 + links, "lag": int(counts.lag)}
    settings |= {name: value for name, value in belief.items() if name not in BELIEF_TABLES}
    lines = [f"  b->{name} = {value!r};" for name, value in settings.items()]
    lines += [f"  b->{name} = {table};" for name, table in BELIEF_TABLES.items()]
    return f"""{c_table("real", "RADIUS", belief["radius"])}
{c_table("real", "FACTORS", belief["factors"].ravel())}
{c_table("real", "GREATEST", belief["greatest"])}
{c_table("real", "SOFTNESS", belief["softness"])}

static void begin(RoverControl *c) {{
  Belief *b = &c->belief;
{chr(10).join(lines)}
  rover_pin_forget(b);
}}

static void estimate(RoverControl *c, const RoverReading *in, RoverCommand *out, real *travel) {{
  Belief *b = &c->belief;
  real sample[{2 + links + 2 * wheels}], highest_duty = in->duty[0];
  int i;
  sample[0] = in->roll;
  sample[1] = in->pitch;
  for (i = 0; i < ROVER_LINKS; ++i) sample[2 + i] = in->suspension[i];
  for (i = 0; i < ROVER_WHEELS; ++i) {{
    sample[2 + ROVER_LINKS + i] = in->wheel_rate[i];
    sample[2 + ROVER_LINKS + ROVER_WHEELS + i] = in->current[i];
    highest_duty = fmax(highest_duty, in->duty[i]);
  }}
  rover_pin_sense(b, sample, highest_duty < {BACKWARDS_DUTY!r}, in->seen_speed);
  for (i = 0; i < ROVER_WHEELS; ++i) {{
    out->slip[i] = b->estimates[4 * i];
    /* The mean depth of the hole plus one SD, to be on the safe side. */
    c->depth[i] = b->estimates[4 * i + 2] + b->estimates[4 * i + 3];
    travel[i] = slip_travel(out->slip[i], {radius!r} * in->wheel_rate[i]);
  }}
  out->stands = b->stuck;
}}
"""


def belief_struct(estimate: OnboardSlip) -> str:
    """Return the C declaration of the struct that is the memory of an on-board slip estimate.

    All arrays have a fixed length, so that the C code allocates no memory.
    """
    wheels, ground = len(estimate.rover.wheels), estimate.expressions[0]
    counts = estimate.belief.struct
    lengths = row_lengths(wheels, len(estimate.places), int(counts.lag), int(counts.n_soils))
    lengths |= {
        "estimates": 4 * wheels,
        "work_w": max(ground.sz_w(), 1),
        "parent": PARTICLES,
        "work_i": ground.sz_iw() + 1,
    }
    return struct_of_fixed_size("RoverBelief", FIELDS, lengths)


def struct_of_fixed_size(name: str, fields: Sequence[Any], lengths: Mapping[str, int]) -> str:
    """Return the C declaration of a struct that contains its arrays, instead of pointers to them.

    Parameters
    ----------
    name : str
        Name of the C type.
    fields : sequence
        Fields of the struct, in the form of `belief.FIELDS`.
    lengths : mapping
        Name of each array -> its length. An array without a length becomes a pointer to a constant table.
    """
    # The C types of the package become those of the exported header; a field with a star is an array.
    lines = ["typedef struct {"]
    for _, groups, form in fields:
        plain = form.replace("double", "rover_real").replace("integer", "int")
        for field in (field for names in groups for field in names.split()):
            if "*" not in form:
                lines.append(f"  {plain.format(field)};")
            elif field in lengths:
                lines.append(f"  {plain.split()[0]} {field}[{lengths[field]}];")
            else:
                lines.append(f"  const rover_real *{field};")
    return "\n".join([*lines, f"}} {name};"])


def with_static_functions(text: str) -> str:
    """Return a C source with static functions `rover_pin_...`, so that the linker does not see their names."""
    return re.sub(r"^(void|int|integer) rover_pin_", r"static \1 rover_pin_", text, flags=re.MULTILINE)


def limit_code(limit: TorqueLimit | NoLimit) -> str:
    """Return the C function `highest`, which returns the highest duty of a wheel that a torque limit allows.

    Without a limit, the highest duty is 1. With a limit, it is the duty at which the motor's torque reaches the torque
    bound of the soil at the present pitch.

    Raises ParameterError: the limit is a class that a user has written in Python.
    """
    table = native_limit(limit)
    if table is CUSTOM_LIMIT:
        raise ParameterError(
            f"A torque limit of the class {type(limit).__name__} cannot be exported, because it is written in Python. "
            "Choose control.limit = at-slip, saturation or none."
        )
    if table is None:
        body = "  (void)in, (void)wheel;\n  return 1.0;"
        return f"static real highest(const RoverReading *in, int wheel) {{\n{body}\n}}\n"
    # TORQUES is transposed, so that the values of one wheel follow one another for the interpolation.
    n_pitches = len(table.pitches)
    return f"""{c_table("real", "PITCHES", table.pitches)}
{c_table("real", "TORQUES", np.array(table.torques).T)}

/* The duty at the torque bound of the present pitch; TORQUES has a row for each wheel. */
static real highest(const RoverReading *in, int wheel) {{
  const real torque = between(in->pitch, PITCHES, TORQUES + wheel * {n_pitches}, {n_pitches});
  return duty_for(torque, {table.stall_torque!r}, in->wheel_rate[wheel] / {table.no_load_rate!r});
}}
"""


def stop_code(control: StopStuck | None) -> str:
    """Return the C function `stop`, which sets all duties to 0 if the rover is stuck. If `control` is None, the
    function never stops the rover.
    """
    if control is None:
        return "static void stop(RoverControl *c, RoverCommand *out) {\n  (void)c;\n  out->stopped = 0;\n}\n"
    # The constants of the low-pass filter and of the two conditions, in the order in which `stops` takes them.
    law, estimate = control.stop, control.estimate
    numbers = (estimate.period / float(law.time), float(law.share), float(law.depth))
    return f"""{c_table("real", "STOP", numbers)}

static void stop(RoverControl *c, RoverCommand *out) {{
  real deepest = 0.0;
  int i;
  for (i = 0; i < ROVER_WHEELS; ++i)
    deepest = fmax(deepest, (c->belief.estimates[4 * i + 2] + c->belief.estimates[4 * i + 3]) / RADIUS[i]);
  if (stops(&c->late_share, out->stands > {float(law.p_stands)!r}, deepest, STOP)) c->stopped = 1;
  if (c->stopped) memset(out->duty, 0, sizeof out->duty);
  out->stopped = c->stopped;
}}
"""


def estimate_code(control: SlipControl) -> str:
    """Return the C functions `begin` and `estimate` of a slip control, which set up its slip estimate and evaluate it.

    Raises ParameterError: the slip estimate is a class that a user has written in Python.
    """
    estimate = control.estimate
    if type(estimate) is TableEstimate:
        return _table_estimate(estimate)
    if type(estimate) is OnboardSlip:
        return _onboard_estimate(estimate, float(control.hole.r) if control.hole else float(estimate.rover.wheel.r))
    if type(estimate) is TrueSlip:
        return GIVEN_SLIP
    raise ParameterError(
        f"A slip estimate of the class {type(estimate).__name__} cannot be exported, because it is written in Python. "
        "Choose control = true, and let your program give the slips with each reading."
    )


MONITOR_TABLES = {"radius": "RADIUS", "pulls": "PULLS", "pull_slopes": "PULL_SLOPES"}
"""Names of the constant C tables behind pointers in the C struct Monitor, by the field of the struct."""
MONITOR_SETTINGS = ("n", "period", "no_load_rate", "stall_current", "sinkage", "buried")
"""Fields of the C struct Monitor that are constants of the rover."""
NUMBERED_CAUSES = ", ".join(f"{at} {name}" for at, name in enumerate((*CAUSES, CANNOT_TELL)))
"""A text with the number of each cause in the C code, followed by its name."""
FORECAST = f"""typedef struct {{ /* forecast for the next seconds under the present duties */
  rover_real p_stuck; /* probability that the rover then does not move although its rims turn */
  rover_real p_buried; /* probability that a wheel is then buried */
  int alarm; /* 1 from when the smoothed p_stuck reaches the level of the alarm until it falls to half of this level */
  int cause; /* {NUMBERED_CAUSES}; -1 none */
  rover_real causes[{len(CAUSES)}]; /* probability of each cause, in this order */
}} RoverForecast;"""
"""C declaration of the struct with the monitor's forecast, which the user's program gets at every sample."""
MONITOR_STEP = """
void rover_monitor_reset(RoverMonitor *m) {{
  memset(m, 0, sizeof *m);
{settings}
  rover_pin_monitor_reset(m);
}}

void rover_monitor_step(RoverMonitor *m, const RoverControl *c, const RoverReading *in, RoverForecast *out) {{
  real posture[2 + {links}] = {{in->roll, in->pitch}};
  memcpy(posture + 2, in->suspension, {links} * sizeof(real));
  if (rover_pin_monitor_check(m, in->duty, in->wheel_rate, in->current, posture, 2 + {links}))
    rover_pin_monitor_foresee(m, &c->belief);
  out->p_stuck = m->p_stuck;
  out->p_buried = m->p_buried;
  out->alarm = m->alarm;
  out->cause = rover_pin_monitor_cause(m);
  memcpy(out->causes, m->causes, 3 * sizeof(real));
  out->causes[3] = m->motor;
  out->causes[4] = m->sensor;
}}
"""


def monitor_header(monitor: Monitor) -> list[str]:
    """Return the lines of the monitor in the C header of an exported control: the structs and functions of the
    monitor.
    """
    return [
        "#define ROVER_MONITOR",
        struct_of_fixed_size("RoverMonitor", monitor_source.FIELDS, monitor_source.lengths(len(monitor.law.radii))),
        FORECAST,
        "void rover_monitor_reset(RoverMonitor *monitor); /* before the first step, together with the control */",
        "void rover_monitor_step(RoverMonitor *monitor, const RoverControl *control, const RoverReading *reading,",
        "                        RoverForecast *forecast); /* after rover_control_step, with the same reading */",
    ]


def monitor_text(monitor: Monitor) -> list[str]:
    """Return the lines of the monitor in the C source of an exported control, which follow the lines of the control
    itself.
    """
    settings = [f"  m->{name} = {getattr(monitor.struct, name)!r};" for name in MONITOR_SETTINGS]
    settings += [f"  m->{name} = {table};" for name, table in MONITOR_TABLES.items()]
    return [
        "typedef RoverMonitor Monitor;",
        c_table("real", "PULLS", monitor.keep["pulls"]),
        c_table("real", "PULL_SLOPES", monitor.keep["pull_slopes"]),
        with_static_functions(monitor_source.c_source()),
        MONITOR_STEP.format(settings="\n".join(settings), links=len(monitor.estimate.places)),
    ]
