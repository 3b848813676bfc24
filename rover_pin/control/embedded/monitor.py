"""The monitor's part of the C file: it reads the belief of the slip control, after each of its steps."""

from rover_pin.control.embedded.estimates import kept_inside, struct_of_fixed_size
from rover_pin.control.monitor.monitor import CANNOT_TELL, CAUSES, Monitor
from rover_pin.control.monitor.source import FIELDS, c_source, lengths
from rover_pin.simulation.native.shared import c_table

TABLES = {"radius": "RADIUS", "pulls": "PULLS", "pull_slopes": "PULL_SLOPES"}
SETTINGS = ("n", "period", "no_load_rate", "stall_current", "sinkage", "buried")
NUMBERED = ", ".join(f"{at} {name}" for at, name in enumerate((*CAUSES, CANNOT_TELL)))
FORECAST = f"""typedef struct {{ /* of the next seconds under the present duties */
  rover_real p_stuck, p_buried; /* probabilities that the rover then stands, its rims turning; that a wheel is buried */
  int alarm; /* whether p_stuck, smoothed, has reached the alarm's level, and has not fallen to half of it since */
  int cause; /* {NUMBERED}; -1 none */
  rover_real causes[{len(CAUSES)}]; /* probability of each, without the last */
}} RoverForecast;"""
STEP = """
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
    """Return the lines of the header."""
    return [
        "#define ROVER_MONITOR",
        struct_of_fixed_size("RoverMonitor", FIELDS, lengths(len(monitor.law.radii))),
        FORECAST,
        "void rover_monitor_reset(RoverMonitor *monitor); /* before the first step, with the control */",
        "void rover_monitor_step(RoverMonitor *monitor, const RoverControl *control, const RoverReading *reading,",
        "                        RoverForecast *forecast); /* after rover_control_step, with the same reading */",
    ]


def monitor_text(monitor: Monitor) -> list[str]:
    """Return the lines of the source, which follow the control's."""
    settings = [f"  m->{name} = {getattr(monitor.struct, name)!r};" for name in SETTINGS]
    settings += [f"  m->{name} = {table};" for name, table in TABLES.items()]
    return [
        "typedef RoverMonitor Monitor;",
        c_table("real", "PULLS", monitor.keep["pulls"]),
        c_table("real", "PULL_SLOPES", monitor.keep["pull_slopes"]),
        kept_inside(c_source()),
        STEP.format(settings="\n".join(settings), links=len(monitor.estimate.places)),
    ]
