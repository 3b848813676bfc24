"""Measure what the derivatives of a drive cost: tangents and differences, as multiples of the drive itself.

    python studies/benchmarks/tangent_speed.py [--quick] [--keep]

The drive is 20 s of the ditch under constant duty, set down and driven once, without its error estimate. "Dual drive"
is the compiled drive with dual numbers alone, for up to seven numbers. "Sensitivities" is the whole call of
`sensitivities`: the drive with its error estimate, its repetition for the time steps, two neighbours for each number
that are set down but do not drive, and the dual drives. Differences need four drives for each number. Times are CPU
seconds of one thread, the minimum of several repeats, after everything has been compiled.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from speed_table import keep, reader

from rover_pin.scenarios.scenario import scenario, settings_of
from rover_pin.scenarios.sensitivities import INPUT_WIDTH, RELATIVE_WIDTH, course_of, drive_at_start, sensitivities
from rover_pin.simulation.driving import loop_of
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.tangents import MAX_NUMBERS, Neighbour, TangentDrive

NUMBERS = (
    "soil.phi soil.k soil.k_1 soil.n soil.theta_1 soil.theta_2 motor.supply motor.resistance motor.k_t motor.gear "
    "motor.rotor_inertia gravity effect.RelaxedSlip.length effect.NormalDamping.d effect.MotionResistance.v_0 "
    "effect.SideShear.scale terrain.depth terrain.wall_angle control.delta start.x"
).split()


def cpu(work: Callable[[], Any], repeats: int) -> float:
    """Return the least CPU time [s] of several repeats, after one that compiles and warms up."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def main() -> None:
    """Measure and print."""
    options = reader(__doc__, "a drive of 4 s, fewer repeats").parse_args()
    duration, repeats = (4.0, 2) if options.quick else (20.0, 5)
    case = scenario("ditch", duration=duration)
    values = {setting.name: setting.value for setting in settings_of("ditch")}
    drive = cpu(lambda: simulate(case.model, case.controller, duration, measure_error=False), 2 * repeats)

    # The compiled parts alone: the loop of the drive, and that with dual numbers.
    course = course_of(case, case.drive())
    length = float(course.lengths.sum())
    loops = [loop_of(drive_at_start(case, course), length)[0] for _ in range(2 * repeats + 1)]
    plain = cpu(lambda: loops[-1].run(len(loops.pop().rows)), 2 * repeats)
    dual = TangentDrive(drive_at_start(case, course), length)
    inputs = []
    for number in NUMBERS[:MAX_NUMBERS]:
        width = INPUT_WIDTH * values[number]
        cases = [
            (side, scenario("ditch", duration=duration, **{number: values[number] + side * width})) for side in (-1, 1)
        ]
        pair = [Neighbour(side / (2 * width), drive_at_start(other, course)) for side, other in cases]
        inputs.append(dual.input_slopes(pair))
    measured = {
        "drive [s]": drive,
        "dual drive of 7 numbers over the compiled loop": cpu(lambda: dual.rows(inputs), repeats) / plain,
    }
    for count in (1, 4, 20):
        whole = cpu(partial(sensitivities, "ditch", NUMBERS[:count], duration=duration), repeats)
        measured[f"sensitivities, {count} tangents, in drives"] = whole / drive
    widths = {number: RELATIVE_WIDTH * values[number] for number in NUMBERS[:4]}
    whole = cpu(lambda: sensitivities("ditch", NUMBERS[:4], widths, duration=duration), repeats)
    measured["sensitivities, 4 differences, in drives"] = whole / drive
    for name, value in measured.items():
        print(f"{name:52s} {value:8.3g}")
    if options.keep:
        keep(measured)


if __name__ == "__main__":
    main()
