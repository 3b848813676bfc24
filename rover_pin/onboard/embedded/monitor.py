"""C code of the monitor in an exported slip control. After each step of the control, the monitor reads the particles of
the control's slip estimate.
"""

from rover_pin.onboard.embedded.estimates import struct_of_fixed_size, with_static_functions
from rover_pin.onboard.monitor.monitor import CANNOT_TELL, CAUSES, Monitor
from rover_pin.onboard.monitor.source import FIELDS, c_source, lengths
from rover_pin.simulation.native.shared import c_table

TABLES = {"radius": "RADIUS", "pulls": "PULLS", "pull_slopes": "PULL_SLOPES"}
"""Names of the constant C tables behind pointers in the C struct Monitor, by the field of the struct."""
SETTINGS = ("n", "period", "no_load_rate", "stall_current", "sinkage", "buried")
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
    """Return the lines of the monitor in the C header of an exported control: the structs and functions of the
    monitor.
    """
    return [
        "#define ROVER_MONITOR",
        struct_of_fixed_size("RoverMonitor", FIELDS, lengths(len(monitor.law.radii))),
        FORECAST,
        "void rover_monitor_reset(RoverMonitor *monitor); /* before the first step, together with the control */",
        "void rover_monitor_step(RoverMonitor *monitor, const RoverControl *control, const RoverReading *reading,",
        "                        RoverForecast *forecast); /* after rover_control_step, with the same reading */",
    ]


def monitor_text(monitor: Monitor) -> list[str]:
    """Return the lines of the monitor in the C source of an exported control, which follow the lines of the control
    itself.
    """
    settings = [f"  m->{name} = {getattr(monitor.struct, name)!r};" for name in SETTINGS]
    settings += [f"  m->{name} = {table};" for name, table in TABLES.items()]
    return [
        "typedef RoverMonitor Monitor;",
        c_table("real", "PULLS", monitor.keep["pulls"]),
        c_table("real", "PULL_SLOPES", monitor.keep["pull_slopes"]),
        with_static_functions(c_source()),
        STEP.format(settings="\n".join(settings), links=len(monitor.estimate.places)),
    ]
