"""Measure the speed of a drive: 20 s of the ditch on one core, by part, against the plain reference and MuJoCo.

    python studies/benchmarks/drive_speed.py [--quick] [--keep]

The ditch has walls of 30 deg and the sand of Table 1, with the traction factor T / (r f_n) of wheel torque T, radius r
and normal force f_n. The stated accuracy is the maximum distance in x, over 20 s, from the same drive at a sixteenth of
the step. Times are CPU seconds of the single thread, the minimum of several repeats, so they equal the wall time on a
free core even if this core is busy. "Plain" is the step in NumPy, CasADi's interpreter and Pinocchio, over the first
second of the drive. MuJoCo (if installed) drives the same URDF with the same masses, motors and rotors, the
differential as an equality constraint, over the same ditch of rigid boxes. MuJoCo has no soil model.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from speed_table import keep, reader

from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation import driving
from rover_pin.simulation import simulate as motion
from rover_pin.simulation.command import Instant, ReadingPlaces
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.native.loop import Loop
from rover_pin.simulation.start import settled_state
from rover_pin.simulation.stepping.timing import TOLERANCE

DURATION = 20.0
WALL, DEPTH, WIDTH, AT = math.radians(30.0), 0.05, 0.2, 0.5


def main() -> None:
    """Measure all parts and print them; with --keep, store them in speed.csv."""
    options = reader(__doc__, "fewer repeats; accuracy against a quarter of the step").parse_args()
    quick = options.quick
    # One core only, so that times do not depend on migration between cores.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    case = scenario("ditch", soil="table-1")
    case.drive()
    seconds = whole_drive(case, 2 if quick else 15)
    coarser = coarsest_kept(case)
    coarse = least(lambda: coarser.drive(measure_error=False), 2 if quick else 15)
    measured = least(case.drive, 2 if quick else 15)
    print(
        f"    at {1e3 * coarser.timing.dt:g} ms, within the tolerance, {coarse:.3f} s; with its error {measured:.3f} s"
    )
    finer = 4 if quick else 16
    off = [distance(case, step, case.timing.dt / finer) for step in (case.timing.dt, coarser.timing.dt)]
    gets_out = scenario("ditch", soil="table-1", **{"soil.k": 0.010, "cruise_slip": 0.05})
    off_out = distance(gets_out, gets_out.timing.dt, gets_out.timing.dt / finer)
    step = parts(case, 500 if quick else 5000)
    asking = python_controller(case, 2 if quick else 15)
    longer = plain(case, 0.2 if quick else 1.0, seconds / DURATION)
    peers = mujoco_drive(case, 1 if quick else 5, (seconds, coarse))
    memory = footprint()
    if options.keep:
        keep(
            {"ditch [s]": seconds, "ditch with its error [s]": measured, "off [mm]": off[0],
             "step within the tolerance [ms]": 1e3 * coarser.timing.dt, "ditch at that step [s]": coarse,
             "off at that step [mm]": off[1], "off with k = 10 mm [mm]": off_out, "step [us]": step,
             "Python controller [us]": asking,
             "plain [x]": longer, "memory [MB]": memory, **peers}
        )  # fmt: skip
    machine, python, cores = platform.machine(), platform.python_version(), os.cpu_count()
    print(f"{machine}, Python {python}, {cores} cores, load {os.getloadavg()[0]:.1f}")


def least(call: Callable[[], Any], repeats: int) -> float:
    """Return the minimum CPU time of a call [s]."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times)


def whole_drive(case: Scenario, repeats: int) -> float:
    """Print and return the time of the whole drive: settling, stepping, control, sampling and the trace [s]."""
    seconds = least(lambda: case.drive(measure_error=False), repeats)
    # The settling at the start is paid once, so it is timed apart.
    settling = least(lambda: settled_state(case.model, case.start, case.symmetric), repeats)
    print(
        f"20 s of the ditch at dt = {1e3 * case.timing.dt:g} ms: {seconds:.3f} s, {DURATION / seconds:.0f} x real time"
    )
    print(
        f"    of these {settling:.3f} s settle the rover at its start; without, {DURATION / (seconds - settling):.0f} x"
    )
    return seconds


def coarsest_kept(case: Scenario) -> Scenario:
    """Return the drive with the coarsest time step that its ground allows and that keeps the error of x within the
    tolerance.
    """
    # The control period divided by 1, 2, 3, ...: from coarse to fine.
    steps = (case.timing.control / parts for parts in itertools.count(1))
    borne = (dt for dt in steps if with_step(case, dt).drive(measure_error=False).attrs["dt_s"] == dt)
    return with_step(case, next(dt for dt in borne if distance(case, dt, case.timing.dt / 16) <= 1e3 * TOLERANCE))


def distance(case: Scenario, dt: float, reference_dt: float) -> float:
    """Print and return the maximum difference in x [mm] between a drive and the same drive with a finer time step."""
    off = 1e3 * float(np.max(np.abs(at_step(case, dt) - at_step(case, reference_dt))))
    print(f"    x at dt = {1e3 * dt:g} ms against dt = {1e3 * reference_dt:g} ms: {off:.4f} mm")
    return off


def with_step(case: Scenario, dt: float) -> Scenario:
    """Return the drive with another time step."""
    return dataclasses.replace(case, timing=dataclasses.replace(case.timing, dt=dt))


def at_step(case: Scenario, dt: float) -> np.ndarray:
    """Return the position x over time [m] of the drive with a given time step."""
    return with_step(case, dt).drive(measure_error=False)["body_x"]


def parts(case: Scenario, count: int) -> float:
    """Print the time of each part of a step in the ditch; return the time of the whole step [us]."""
    state = settled_state(case.model, case.start, case.symmetric)
    kernel = Kernel(case.model, state, case.timing.dt, case.symmetric)
    kernel.duty[:] = 0.55
    # The rover is inside the ditch after 10 s, where the contacts are most expensive.
    for _ in range(round(10.0 / case.timing.dt)):
        kernel.step()
    model, data, keep = kernel.pin_model, kernel.pin_model.createData(), state.copy()
    step_us = 1e6 * each(kernel.step, count)
    state.q[:], state.v[:], state.contact[:] = keep.q, keep.v, keep.contact
    crba = 1e6 * each(lambda: pin.crba(model, data, state.q, pin.Convention.WORLD), count)
    nle = 1e6 * each(lambda: pin.nonLinearEffects(model, data, state.q, state.v), count)
    drive = driving.RunningDrive(case.model, state, kernel, case.controller, case.timing)
    loop, reading = Loop(kernel, case.timing.dt, 1, 1), Instant(np.zeros(1), 0, ReadingPlaces.of(case.model))
    obey = 1e6 * each(lambda: driving.obey(drive, reading), count)
    row = 1e6 * each(loop.now, count)
    print(f"microseconds per step: {step_us:.1f} in all; Pinocchio's crba {crba:.1f} and its nle {nle:.1f} beside it")
    shares = case.timing.dt / case.timing.control, case.timing.dt / case.timing.sample
    print(f"    a controller asked and obeyed {obey:.1f} us, {obey * shares[0]:.1f} us a step; ", end="")
    print(f"sampling {row:.1f} us a row, {row * shares[1]:.1f} us a step")
    return step_us


def each(call: Callable[[], Any], count: int) -> float:
    """Return the time of one call [s]: the calls are timed in several short loops, and the smallest mean time of a loop
    is returned.
    """

    def loop() -> None:
        for _ in range(50):
            call()

    return least(loop, max(2, count // 50)) / 50


def python_controller(case: Scenario, repeats: int) -> float:
    """Print and return the additional time of a controller in Python, which reads nothing, for each sample [us]."""
    times = [math.inf, math.inf]
    for _ in range(repeats):
        # The compiled controller and one in Python alternate, so that both meet the same load of the machine.
        for i, controller in enumerate((case.controller, lambda reading: 0.55)):
            times[i] = min(times[i], least(lambda c=controller: drive_under(case, c), 1))  # type: ignore[misc]
    # The difference, spread over the control samples of the drive.
    each_sample = 1e6 * (times[1] - times[0]) * case.timing.control / DURATION
    print(f"    a controller in Python {each_sample:.1f} us a sample, all included")
    return each_sample


def drive_under(case: Scenario, controller: Any) -> None:
    """Drive the scenario under another controller."""
    once = {"symmetric": case.symmetric, "measure_error": False}
    motion.simulate(case.model, controller, DURATION, case.start, case.timing, **once)


def plain(case: Scenario, duration: float, ours: float) -> float:
    """Print and return the time ratio of the plain reference to the kernel, and print the difference of final x."""
    options = {
        "start": settled_state(case.model, case.start, case.symmetric),
        "timing": case.timing,
        "symmetric": case.symmetric,
    }
    # Process time counts this process only, so other work on the machine does not enter.
    begin = time.process_time()
    trace = motion.simulate(case.model, case.controller, duration, **options, engine="pinocchio-crba")
    seconds = time.process_time() - begin
    off = abs(trace["body_x"][-1] - motion.simulate(case.model, case.controller, duration, **options)["body_x"][-1])
    print(
        f"plain reference: {seconds / duration:.2f} s a second, {seconds / duration / ours:.0f} times as long; ", end=""
    )
    print(f"x after {duration:g} s differs by {1e3 * off:.1e} mm")
    return seconds / duration / ours


def mujoco_drive(case: Scenario, repeats: int, ours: tuple[float, float]) -> dict[str, float]:
    """Print and return MuJoCo's time for 20 s over the same rigid ditch, and its ratio to our times."""
    try:
        import mujoco
    except ImportError:
        print("MuJoCo: not installed")
        return {}
    times = {}
    # A step of 2 ms and twice it.
    for dt, integrator in ((0.002, "mjINT_IMPLICITFAST"), (0.004, "mjINT_IMPLICITFAST")):
        model = mujoco_model(mujoco, case, dt, getattr(mujoco.mjtIntegrator, integrator))
        ends = []

        def run(model: Any = model, ends: list[float] = ends) -> None:
            data = mujoco.MjData(model)
            data.ctrl[:] = 0.55
            mujoco.mj_step(model, data, round(DURATION / model.opt.timestep))
            ends.append(float(data.qpos[0]))

        seconds = least(run, repeats)
        times[f"MuJoCo at {1e3 * dt:g} ms [s]"] = seconds
        print(
            f"MuJoCo {mujoco.__version__}, rigid, dt = {1e3 * dt:g} ms: {seconds:.3f} s, {DURATION / seconds:.0f} x ",
            end="",
        )
        print(
            f"real time, {seconds / ours[0]:.1f} times ours, {seconds / ours[1]:.1f} times at our coarsest step; ",
            end="",
        )
        print(f"the rover ends at x = {ends[-1]:.2f} m")
    return times


def mujoco_model(mujoco: Any, case: Scenario, dt: float, integrator: Any) -> Any:
    """Return MuJoCo's model of our URDF with our motors, on a ditch of boxes."""
    spec = mujoco.MjSpec.from_string(case.model.rover.urdf)
    spec.compiler.fusestatic, spec.compiler.discardvisual = False, True
    spec.option.timestep, spec.option.integrator = dt, integrator
    base = spec.worldbody.first_body()
    base.pos = [0.0, 0.0, 0.13 + 0.001]
    base.add_freejoint()
    motor = case.model.motor
    for wheel in case.model.rover.wheels:
        joint = spec.joint(case.model.rover.model.names[wheel.joint])
        joint.armature = float(motor.armature)
        # The back-EMF is a velocity-dependent bias of MuJoCo's general actuator.
        back = float(motor.stall_torque / motor.no_load_rate)
        act = spec.add_actuator(name=f"motor_{wheel.name}", target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        act.gainprm[0], act.biastype, act.biasprm[2] = float(motor.stall_torque), mujoco.mjtBias.mjBIAS_AFFINE, -back
    for joint in spec.joints:
        if joint.name.startswith("steer"):
            joint.stiffness[0], joint.damping[0] = 20.0, 0.2
    differential = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1="rocker_l", name2="rocker_r")
    differential.data[:2] = 0.0, -1.0
    add_ditch(mujoco, spec)
    return spec.compile()


def add_ditch(mujoco: Any, spec: Any) -> None:
    """Add ground, walls and floor of the ditch as boxes whose top faces form the profile."""
    # Corners of the profile from left to right: ground, wall down, floor, wall up, ground.
    run = DEPTH / math.tan(WALL)
    corners = [(-3.0, 0.0), (AT, 0.0), (AT + run, -DEPTH), (AT + WIDTH - run, -DEPTH), (AT + WIDTH, 0.0), (5.0, 0.0)]
    for (x0, z0), (x1, z1) in zip(corners[:-1], corners[1:], strict=True):
        length, angle = math.hypot(x1 - x0, z1 - z0), math.atan2(z1 - z0, x1 - x0)
        # A box is 0.1 m thick, so its middle lies 0.05 m below the profile, along the normal.
        middle = np.array([(x0 + x1) / 2, 0.0, (z0 + z1) / 2]) - 0.05 * np.array(
            [-math.sin(angle), 0.0, math.cos(angle)]
        )
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[length / 2, 1.0, 0.05],
            pos=middle,
            quat=[math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0],
        )


def footprint() -> float:
    """Print import time and peak memory; return the peak memory of a drive without MuJoCo [MB]."""
    # A fresh process, because this one has MuJoCo and the benchmarks in memory.
    code = (
        "import time; t = time.perf_counter(); import rover_pin; a = time.perf_counter() - t\n"
        "from rover_pin.scenarios.scenario import scenario; b = time.perf_counter() - t\n"
        "scenario('ditch', soil='table-1').drive()\n"
        "peak = next(line for line in open('/proc/self/status') if line.startswith('VmHWM'))\n"
        "print(a, b, int(peak.split()[1]) / 1024)"
    )
    # The minimum of three processes, because the first one may fill the file cache.
    got = [
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
        for _ in range(3)
    ]
    bare, scenes, memory = np.min([[float(word) for word in line.split()] for line in got], axis=0)
    print(f"import rover_pin {bare:.2f} s, with its scenarios {scenes:.2f} s; peak memory of a drive {memory:.0f} MB")
    print(f"peak memory of this benchmark {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    return float(memory)


if __name__ == "__main__":
    main()
