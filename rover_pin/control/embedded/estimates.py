"""The parts of the C file that depend on what is taken away: estimates of the slip, the torque limit, the stop."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.control.sensing.belief import FIELDS, PARTICLES, row_lengths
from rover_pin.control.sensing.onboard_slip import BACKWARDS, OnboardSlip
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.control.slip_control import SlipControl
from rover_pin.control.slip_estimate import TableEstimate, TrueSlip
from rover_pin.control.torque_check import CUSTOM_LIMIT, NoLimit, TorqueLimit, native_limit
from rover_pin.simulation.native.shared import c_table

TABLES = {"radius": "RADIUS", "factors": "FACTORS"}
"""Fields of the belief that point at a table."""


def of_table(estimate: TableEstimate) -> str:
    """Return C of Eq (9): slip and travel from the duty now applied and the wheel's rate."""
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


OF_READING = """static void estimate(RoverControl *c, const RoverReading *in, RoverCommand *out, real *travel) {
  (void)c;
  memcpy(out->slip, in->slip, sizeof in->slip);
  memcpy(travel, in->travel, sizeof in->travel);
  out->stands = 0.0;
}
static void begin(RoverControl *c) { (void)c; }
"""
"""C of an estimate of the user's own: slip and travel are read."""


def on_board(estimate: OnboardSlip, radius: float) -> str:
    """Return C of the on-board estimate; a wheel's travel is by Eq (1) from its slip, its rim's radius `radius` [m]."""
    wheels, links = len(estimate.rover.wheels), len(estimate.places)
    belief = estimate.belief.numbers
    settings = {"n": wheels, "N": PARTICLES, "n_posture": 2 + links, "lag": int(estimate.belief.struct.lag)}
    settings |= {name: value for name, value in belief.items() if name not in TABLES}
    lines = [f"  b->{name} = {value!r};" for name, value in settings.items()]
    lines += [f"  b->{name} = {table};" for name, table in TABLES.items()]
    return f"""{c_table("real", "RADIUS", belief["radius"])}
{c_table("real", "FACTORS", belief["factors"])}

static void begin(RoverControl *c) {{
  Belief *b = &c->belief;
{chr(10).join(lines)}
  rover_pin_forget(b);
}}

static void estimate(RoverControl *c, const RoverReading *in, RoverCommand *out, real *travel) {{
  Belief *b = &c->belief;
  real sample[{2 + links + 2 * wheels}], most = in->duty[0];
  int i;
  sample[0] = in->roll;
  sample[1] = in->pitch;
  for (i = 0; i < ROVER_LINKS; ++i) sample[2 + i] = in->suspension[i];
  for (i = 0; i < ROVER_WHEELS; ++i) {{
    sample[2 + ROVER_LINKS + i] = in->wheel_rate[i];
    sample[2 + ROVER_LINKS + ROVER_WHEELS + i] = in->current[i];
    most = fmax(most, in->duty[i]);
  }}
  rover_pin_sense(b, sample, most < {BACKWARDS!r}, in->seen_speed);
  for (i = 0; i < ROVER_WHEELS; ++i) {{
    out->slip[i] = b->told[4 * i];
    c->depth[i] = b->told[4 * i + 2] + b->told[4 * i + 3];
    travel[i] = slip_travel(out->slip[i], {radius!r} * in->wheel_rate[i]);
  }}
  out->stands = b->stuck;
}}
"""


def belief_struct(estimate: OnboardSlip) -> str:
    """Return the C declaration of the estimator's memory: arrays of fixed length, nothing is allocated."""
    wheels, ground = len(estimate.rover.wheels), estimate.expressions[0]
    lengths = row_lengths(wheels, len(estimate.places), int(estimate.belief.struct.lag))
    lengths |= {"told": 4 * wheels, "work_w": max(ground.sz_w(), 1), "parent": PARTICLES, "work_i": ground.sz_iw() + 1}
    return struct_of_fixed_size("RoverBelief", FIELDS, lengths)


def struct_of_fixed_size(name: str, fields: Sequence[Any], lengths: Mapping[str, int]) -> str:
    """Return the C declaration of a struct whose arrays lie within it; those without a length are constant tables."""
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


def kept_inside(text: str) -> str:
    """Return C of the package with its functions static."""
    return re.sub(r"^(void|int|integer) rover_pin_", r"static \1 rover_pin_", text, flags=re.MULTILINE)


def of_limit(limit: TorqueLimit | NoLimit) -> str:
    """Return C of the highest duty of a wheel, 1 or by the torque bound at the pitch; your own limit is refused."""
    table = native_limit(limit)
    if table is CUSTOM_LIMIT:
        raise ParameterError(
            f"A torque limit of the class {type(limit).__name__} cannot be taken away: choose control.limit = at-slip, "
            "saturation or none."
        )
    if table is None:
        body = "  (void)in, (void)wheel;\n  return 1.0;"
        return f"static real highest(const RoverReading *in, int wheel) {{\n{body}\n}}\n"
    many = len(table.pitches)
    return f"""{c_table("real", "PITCHES", table.pitches)}
{c_table("real", "TORQUES", np.array(table.torques).T)}

static real highest(const RoverReading *in, int wheel) {{ /* T_lim at this pitch, a row a wheel */
  const real torque = between(in->pitch, PITCHES, TORQUES + wheel * {many}, {many});
  return duty_for(torque, {table.stall_torque!r}, in->wheel_rate[wheel] / {table.no_load_rate!r});
}}
"""


def of_stop(control: StopStuck | None) -> str:
    """Return C of the stop of a rover that is stuck, or of none."""
    if control is None:
        return "static void stop(RoverControl *c, RoverCommand *out) {\n  (void)c;\n  out->stopped = 0;\n}\n"
    law, estimate = control.stop, control.estimate
    numbers = (estimate.period / float(law.time), float(law.share), float(law.depth))
    return f"""{c_table("real", "STOP", numbers)}

static void stop(RoverControl *c, RoverCommand *out) {{
  real deepest = 0.0;
  int i;
  for (i = 0; i < ROVER_WHEELS; ++i)
    deepest = fmax(deepest, (c->belief.told[4 * i + 2] + c->belief.told[4 * i + 3]) / RADIUS[i]);
  if (stops(&c->late_share, out->stands > {float(law.p_stands)!r}, deepest, STOP)) c->stopped = 1;
  if (c->stopped) memset(out->duty, 0, sizeof out->duty);
  out->stopped = c->stopped;
}}
"""


def of_estimate(control: SlipControl) -> str:
    """Return C of a slip control's estimate.

    Raises ParameterError: an estimate of another class: it stays where it is, and its slip is given with each reading.
    """
    estimate = control.estimate
    if type(estimate) is TableEstimate:
        return of_table(estimate)
    if type(estimate) is OnboardSlip:
        return on_board(estimate, float(control.hole.r) if control.hole else float(estimate.rover.wheel.r))
    if type(estimate) is TrueSlip:
        return OF_READING
    raise ParameterError(
        f"A slip estimate of the class {type(estimate).__name__} cannot be taken away: choose control = true, and give "
        "the slips with each reading."
    )
