"""What must hold of any drive: 1,000 of them at random (slow), and the first 20 in every run."""

import importlib.util
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_pin.errors import RoverPinError
from rover_pin.motion.place import RESTS, SLIDES, set_down
from rover_pin.motion.simulate import Timing
from rover_pin.motion.state import roll_pitch_yaw

_spec = importlib.util.spec_from_file_location("random_drives", Path(__file__).parent / "random_drives.py")
random_drives = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = random_drives
_spec.loader.exec_module(random_drives)

DRIVES, FEW = 1000, 20
REPEATED = 20
"""Every which drive is repeated; every one is driven at half the step."""
STEP_ERROR = (1e-3, 0.005)
"""Change at half the step that a drive need not confess: so many metres, and this share of its way."""
UNSAID, UNSAID_SHARE = "half the step moves it", 0.01
"""What a drive may leave unsaid, and in how many."""
DOUBTS = ("the soil carried", "wheels' forces turned faster", "the wheels were off the ground")


def faults(seed):
    """Return what is wrong with a drive, and whether it drove at all."""
    try:
        chosen = random_drives.drive(seed)
        trace = chosen.drive(Timing())
    except RoverPinError as error:
        return ([] if "\n" not in str(error) else ["a refusal of several lines"]), False
    if not len(trace.t):
        return ([] if str(trace.attrs["stop"]).startswith("diverged") else ["no rows and no reason"]), True
    found = [*of_start(chosen, trace), *of_trace(trace), *of_stop(chosen, trace)]
    if seed % REPEATED == 0 and any(
        chosen.drive(Timing())[name].tobytes() != values.tobytes() for name, values in trace.channels.items()
    ):
        found.append("another run gives other bytes")
    found += of_half_step(chosen, trace)
    return found, True


def doubts(warning):
    """Whether a warning says that the drive's steps are not to be believed."""
    return warning.startswith(DOUBTS)


def of_start(chosen, trace):
    down = set_down(chosen.model, chosen.start)
    off = np.hypot(*(down.state.q[:2] - (chosen.start.x, chosen.start.y)))
    turn = math.remainder(roll_pitch_yaw(down.state.q)[2] - chosen.start.yaw, 2 * math.pi)
    found = [] if off < 1e-9 and abs(turn) < 1e-9 and not down.state.v.any() else ["it does not start where asked"]
    return found if trace.attrs["set_down"] == down.standing in (RESTS, SLIDES) else [*found, "its start is not said"]


def of_trace(trace):
    found = [f"{name} is not finite" for name, values in trace.channels.items() if not np.isfinite(values).all()]
    doubted = str(trace.attrs["stop"]).startswith("diverged") or any(map(doubts, trace.attrs["warnings"]))
    turned = max(np.ptp(values) for name, values in trace.channels.items() if name.startswith("energy_"))
    scale = max(turned, trace.stack("normal").sum(axis=1).mean() * min(trace.attrs["wheel_radii_m"]))
    if turned > 1e-6 * scale and not (doubted or trace.energy_error() < 0.01):
        found.append(f"its energy is off by {trace.energy_error():.2g}")
    told = doubted or trace.attrs["warnings"] or len(trace.t) < 2
    if trace["energy_soil"][-1] < -0.01 * scale and not told:
        found.append("the soil gave energy without a word")
    return found


def of_stop(chosen, trace):
    stop, last = str(trace.attrs["stop"]), {name: float(trace[name][-1]) for name in trace.channels}
    if stop == "duration":
        return [] if last["t_s"] == pytest.approx(random_drives.DURATION) else ["it stopped early without a reason"]
    lean = math.acos(math.cos(last["body_roll"]) * math.cos(last["body_pitch"]))
    sinkage = max(last[f"sinkage_{each.name}"] / each.wheel.r for each in chosen.model.rover.wheels)
    speed = max(abs(last[f"body_v{axis}"]) for axis in "xyz")
    true = {
        "capsized": lean > math.radians(59.9),
        "buried": sinkage > chosen.model.buried,
        "folded": any(word in stop for word in ("past its stop",)),
        "diverged": speed > 5.0 or "not finite" in stop or "singular" in stop or overflowed(stop, last["t_s"]),
    }
    reason = re.match(r"(\w+)", stop)
    return [] if reason and true.get(reason[1]) else [f"its reason to stop is not true: {stop}"]


def overflowed(stop, last):
    """Whether rows that held no numbers were left out at the end."""
    said = re.search(r"at ([\d.]+) s$", stop)
    return said is not None and last < float(said[1]) - 1e-6


def of_half_step(chosen, trace):
    """What a drive to its end must say by itself, without the other beside it."""
    if any(map(doubts, trace.attrs["warnings"])) or trace.attrs["stop"] != "duration":
        return []
    half = chosen.drive(Timing().halved())
    rows = min(len(trace.t), len(half.t))
    if not rows:
        return [f"{UNSAID} out of bounds"]
    off = np.hypot(*(trace[name][:rows] - half[name][:rows] for name in ("body_x", "body_y"))).max()
    way = np.hypot(np.diff(trace["body_x"]), np.diff(trace["body_y"])).sum()
    return [] if off < STEP_ERROR[0] + STEP_ERROR[1] * way else [f"{UNSAID} by {1e3 * off:.2g} mm"]


def assert_sound(seeds):
    results = {seed: faults(seed) for seed in seeds}
    wrong = {seed: found for seed, (found, _) in results.items() if found}
    unsaid = {seed: found for seed, found in wrong.items() if all(each.startswith(UNSAID) for each in found)}
    assert wrong.keys() == unsaid.keys(), wrong
    assert len(unsaid) <= max(1, UNSAID_SHARE * len(seeds)), unsaid
    assert np.mean([drove for _, drove in results.values()]) > 0.5


def test_a_few_random_drives_are_sound():
    assert_sound(range(FEW))


@pytest.mark.slow
def test_a_thousand_random_drives_are_sound():
    assert_sound(range(DRIVES))
