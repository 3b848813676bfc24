"""Checks of rig data against physics that holds for every wheel on every soil, to find wrong signs, units and radii.

The most important law is the balance of work. Consider one metre of travel or of rim travel, whichever is longer: the
rim turns by `rim` metres and the wheel travels `travel` metres. With the torque T, the radius r and the drawbar pull
f_t, T rim / r is the work that the motor puts in, and f_t travel the work that the wheel gives out. Soil is passive, so
that the work given out cannot exceed the work put in.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from rover_pin.base.errors import DataError
from rover_pin.estimation.profile import CLEAR_SDS
from rover_pin.measurements.channel import DrawbarPull, RigChannel, SideForce, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import RigSet
from rover_pin.soil.slip import rim_and_travel

LOAD_RANGE = (1e-4, 1e7)
"""Range of accepted wheel loads [N]: from a wheel of a model of a few grams to a wheel of a mining truck."""
MAX_MEDIAN_FORCE, MAX_FORCE = 3.0, 100.0
"""Largest accepted ratio of the pull, or of torque / r, to the load: first for the median of all runs, then for a
single run. Data with a larger ratio are refused. Sand gives up to 0.7, lugs in clay about 1."""
DOUBTFUL_FORCE = {DrawbarPull: 1.0, Torque: 1.5}
"""Maximum median ratio of pull to load, and of torque to r times load, of data that are not doubted. Sand gives up to
0.7, lugs in clay about 1. The torque may be larger than the pull times r, because it also overcomes the motion
resistance."""
DRIVING, SLIPPING = 0.1, 0.3
"""Minimum slip of a wheel that certainly drives, and minimum slip of a wheel that has certainly sheared the soil.
Smaller slips may be errors of the radius, which is known to a few percent (assumed)."""
MIN_TORQUE, DOUBTFUL_TORQUE = 0.003, 0.01
"""Smallest ratio of the torque of a slipping wheel to r times load. Data below MIN_TORQUE are refused, and data below
DOUBTFUL_TORQUE are reported as doubtful. Reason: a soil at its bearing limit of 5.1 c (Prandtl) still resists with the
ratio c / (5.1 c) = 0.2; if k is ten times the contact length, a tenth of this remains, which is 0.02."""
MAX_EFFICIENCY = 1.5
"""Largest accepted ratio of the work that the wheel gives out to the work that its torque puts in. Data with a larger
ratio are refused. Without errors of the measurement the ratio is below 1; a wrong zero or radius explains an excess of
a few percent (assumed), but not of 50 %."""
MIN_RESOLUTION = 1e-12
"""Smallest accepted ratio of a channel's noise to its largest value. Data with a smaller ratio are refused, because no
converter has 40 bits."""
DOUBTFUL_PULL = 0.02
"""Ratio of pull to load that at least one run must reach if the slips span more than SLIPPING; otherwise the pull is
reported as doubtful. Soil gives ratios of 0.1 or more, so that a pull that stays below 0.02 is in another unit, or its
sensor was not connected."""
MIN_STIFFNESS, MIN_STIFFNESS_WIDTH, MAX_STIFFNESS = 1e5, 1e4, 1e9
"""Limits of the soil's stiffness (pressure divided by sinkage) within which rig data are not doubted.

The data are reported as doubtful if the stiffness is below the first value [Pa/m] and its product with the wheel's
width is below the second [Pa], or if the stiffness exceeds the third [Pa/m]. The soils of this package, under wheels of
5 mm to 1 m and 1 N to 100 kN, give 2e4 to 7e6 Pa/m."""
LARGE_SLIP_ANGLE = math.radians(30.0)
"""Minimum slip angle [rad] of a run with a sinkage deeper than the axle that is accepted: a wheel that is pushed along
its axle bulldozes sand instead of rolling over it."""
MIN_TREND_RUNS, FALLING = 4, -0.7
"""Minimum number of runs for a trend of the pull, and maximum rank correlation with slip of a pull that counts as
falling."""
SLENDERNESS = (0.05, 5.0)
"""Range of the ratio of width to diameter of usual wheels: 0.05 for a bicycle, 2 for a road roller."""


class PhysicsCheck(NamedTuple):
    """Result of one physical check of rig data: whether a limit is exceeded, and the finding to report if it is."""

    is_beyond: bool | np.bool_
    what: str
    todo: str
    column: str = ""
    "column of the points that the check concerns; empty for the whole data set"


def refuse_impossible(data: RigSet) -> None:
    """Raise DataError if rig data have a number that no wheel on any soil can give; the message states the first such
    number and its probable cause.
    """
    for check in _impossible(data):
        if check.is_beyond:
            raise DataError(f"{Finding(check.what, data.name, check.todo)}")


def suspicions(data: RigSet) -> list[Finding]:
    """Return findings on numbers of a rig data set that are possible but improbable, such as a load in kg or a reversed
    sign.
    """
    return [Finding(check.what, data.name, check.todo) for check in _doubtful(data) if check.is_beyond]


def _impossible(data: RigSet) -> Iterator[PhysicsCheck]:
    """Yield the checks of sizes, signs and the balance of work; if one of them fails, the data set is refused."""
    # Loads in kN or kg of a full-scale machine are within the range; only impossible ones are refused here.
    low, high = data.load.min(), data.load.max()
    what = f"load_N ranges from {low:g} to {high:g} N, which no wheel carries"
    todo = f"give newtons, from {LOAD_RANGE[0]:g} to {LOAD_RANGE[1]:g}"
    yield PhysicsCheck(not (low >= LOAD_RANGE[0] and high <= LOAD_RANGE[1]), what, todo)
    for channel in data.channels:
        name, largest = channel.column, np.nanmax(np.abs(channel.measured), initial=1e-300)
        # Forces and torques are compared with the load; a sinkage has no such scale.
        if not isinstance(channel, Sinkage):
            share, scale = np.abs(_over_load(data, channel.measured, channel.unit)), _scale_name(channel.unit)
            median, row = float(np.nanmedian(share)), int(np.nanargmax(share))
            what = f"{name} is {median:.3g} times the {scale}, more than any soil gives"
            yield PhysicsCheck(median > MAX_MEDIAN_FORCE, what, f"check the units of {name} and load_N")
            what = f"{name} is {share[row]:.3g} times the {scale} in row {row + 1}"
            yield PhysicsCheck(share[row] > MAX_FORCE, what, "correct or remove that row")
        # A noise that is too small would make every model appear wrong.
        finest = float(np.min(channel.sd / largest))
        what = f"the noise of {name} is {finest:.2g} times its largest value, which is finer than any sensor"
        yield PhysicsCheck(finest < MIN_RESOLUTION, what, "state the SD of one run, from repeats")

    # Signs: sinkage is positive downwards, torque positive when driving, pull positive forwards.
    every = np.ones(data.slip.size, dtype=bool)
    for kind, use, sign, when, positive in (
        (Sinkage, every, 1.0, "", "down"),
        (Torque, data.slip > DRIVING, 1.0, f" at slips above {DRIVING:g}, where the wheel drives", "driving"),
        (DrawbarPull, data.slip < -DRIVING, -1.0, f" at slips below {-DRIVING:g}, where the wheel brakes", "forwards"),
    ):
        measured, sd = _read(data, kind)
        median, word = _some(np.median, measured[use]), "negative" if sign > 0.0 else "positive"
        what = f"{kind.column} is {word}{when} ({median:.3g} in the median)"
        is_turned = sign * median < -CLEAR_SDS * _some(np.median, sd[use])
        yield PhysicsCheck(is_turned, what, f"multiply the column by -1: positive is {positive}")

    # Work: a driving wheel gives out no more work than its torque puts in.
    put_in, out, _ = work(data)
    drives = (data.slip > DRIVING) & (out > 0.0) & np.isfinite(put_in)
    work_in, work_out = _some(np.median, put_in[drives]), _some(np.median, out[drives])
    times = work_out / work_in if work_in > 0.0 else np.inf
    what = f"the driving wheel gives out {times:.3g} times the work that its torque puts in, in the median"
    todo = "check the units of torque_Nm and drawbar_pull_N, and the wheel's r"
    yield PhysicsCheck(work_out > MAX_EFFICIENCY * work_in, what, todo)
    yield _little_torque(data, MIN_TORQUE)


def work(data: RigSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the work put in, the work given out, and the SD of their difference [J/m], each as an array (runs,).

    With the torque T, the radius r and the drawbar pull f_t, T rim / r is the work that the motor puts in, and f_t
    travel the work that the wheel gives out. The work is per metre of travel or of rim travel, whichever is longer. It
    is NaN in runs without a torque or a pull.
    """
    # Per metre of the longer distance, rim and travel follow from the slip alone.
    (torque, torque_sd), (pull, pull_sd), r = _read(data, Torque), _read(data, DrawbarPull), float(data.wheel.r)
    rim, travel = rim_and_travel(data.slip)
    return torque / r * rim, pull * travel, np.hypot(torque_sd / r * rim, pull_sd * travel)


def _little_torque(data: RigSet, limit: float) -> PhysicsCheck:
    """Return the check that finds a torque too small for a slipping wheel: below `limit` times load times radius."""
    # A slipping wheel shears the soil, which needs torque.
    share = _some(np.median, _over_load(data, _read(data, Torque)[0], "N m")[data.slip > SLIPPING])
    what = f"torque_Nm at slips above {SLIPPING:g} is {share:.2g} times load times radius, less than any soil gives"
    return PhysicsCheck(share < limit, what, "check the units of torque_Nm and load_N, and the wheel's r")


def _doubtful(data: RigSet) -> Iterator[PhysicsCheck]:
    """Yield the checks that find a wrong unit, and an improbable pull, sinkage or vertical moment."""
    # A width or radius in another unit gives an impossible ratio.
    slender = float(data.wheel.b) / (2.0 * float(data.wheel.r))
    what = f"the wheel's width is {slender:.2g} times its diameter"
    yield PhysicsCheck(
        not SLENDERNESS[0] <= slender <= SLENDERNESS[1], what, "check r and b of [wheel], and their units"
    )
    for kind, limit in DOUBTFUL_FORCE.items():
        share = _some(np.median, _over_load(data, _read(data, kind)[0], kind.unit)[data.slip > DRIVING])
        what = f"{kind.column} is {share:.3g} times the {_scale_name(kind.unit)} in the median, more than sand gives"
        yield PhysicsCheck(share > limit, what, "check whether load_N is in kg, or a sensor has an offset")
    yield _little_torque(data, DOUBTFUL_TORQUE)

    # Pull: the pull must not give out more work than was put in, must not fall with slip, and must not stay at zero.
    # A single run may exceed the balance by noise, so the excess is compared with its SD.
    put_in, out, sd = work(data)
    gains = (data.slip > DRIVING) & (out - put_in > CLEAR_SDS * sd)
    what = f"{int(gains.sum())} of {gains.size} runs give out more work than their torque puts in"
    yield PhysicsCheck(gains.any(), what, "the torque sensor's zero or the wheel's r is wrong")

    # A pull with the wrong sign falls with slip and ends below zero.
    pull, sd = _read(data, DrawbarPull)
    runs = np.flatnonzero((data.slip > -DRIVING) & np.isfinite(pull))
    if runs.size >= MIN_TREND_RUNS and np.ptp(data.slip[runs]) >= SLIPPING:
        order = runs[np.argsort(data.slip[runs])]
        low, high = (float(np.median(pull[part])) for part in (order[: runs.size // 3], order[-(runs.size // 3) :]))
        falls = spearmanr(data.slip[order], pull[order]).statistic < FALLING
        what = f"drawbar_pull_N falls with slip, from {low:.3g} to {high:.3g} N"
        todo = "check its sign: positive is forwards, and the pull of a wheel rises with slip before the wheel digs in"
        yield PhysicsCheck(falls and high < -CLEAR_SDS * float(np.median(sd[runs])), what, todo)

    # A pull that is nearly zero at all slips is in another unit or was not connected.
    largest, span = _some(np.max, np.abs(_over_load(data, pull, "N"))), np.ptp(data.slip)
    what = f"drawbar_pull_N never exceeds {largest:.2g} times the load, although the slips span {span:.2g}"
    yield PhysicsCheck(
        span > SLIPPING and largest < DOUBTFUL_PULL, what, "soil gives 0.1 or more: check the units of both columns"
    )

    # Sinkage: the stiffness of the soil is the mean pressure under the chord of the contact, over sinkage. Sinkages
    # that do not exceed their noise are left out, because they would make the soil look rigid.
    sunk, sd = _read(data, Sinkage)
    use = sunk > np.maximum(CLEAR_SDS * sd, 0.0)
    r, b, h = float(data.wheel.r), float(data.wheel.b), sunk[use]
    chord = np.sqrt(2.0 * r * h)  # length of the contact for a small sinkage
    stiffness = _some(np.median, data.load[use] / (b * chord * h))
    soft = stiffness < MIN_STIFFNESS and b * stiffness < MIN_STIFFNESS_WIDTH
    what = f"pressure over sinkage is {stiffness:.2g} Pa/m, {'softer than loose sand' if soft else 'stiffer than clay'}"
    todo = "check load_N (newtons, not kg), sinkage_m, and r and b of [wheel]"
    yield PhysicsCheck(soft or stiffness > MAX_STIFFNESS, what, todo)

    # Depth: only a wheel that is pushed sideways sinks deeper than its axle.
    ahead = np.where(np.abs(data.slip_angle) < LARGE_SLIP_ANGLE, sunk, np.nan)
    deepest = _some(np.max, ahead)
    row = int(np.nanargmax(ahead)) + 1 if np.isfinite(deepest) else 0
    what = f"sinkage_m is {deepest:.3g} m in row {row}, deeper than the axle of a wheel of radius {r:g} m"
    yield PhysicsCheck(
        deepest > r, what, "check the unit and the zero of sinkage_m, because no model predicts such a run"
    )

    # A vertical moment is too large for the side force if the force would act beyond the wheel.
    (moment, moment_sd), (side, side_sd) = _read(data, VerticalMoment), _read(data, SideForce)
    use = np.isfinite(moment) & data.askew & (np.abs(side) > CLEAR_SDS * side_sd)
    # The moment over the side force is the lever arm of the side force ahead of the wheel's centre.
    arm, arm_sd = (_some(np.median, ratio) for ratio in (moment[use] / side[use], moment_sd[use] / np.abs(side[use])))
    where = "ahead of" if arm > 0.0 else "behind"
    what = f"{VerticalMoment.column} means that the side force acts {abs(arm):.3g} m {where} the axle, beyond the rim"
    todo = "convert the moment to the wheel's centre, or state moment_arm in [rig], and check its unit"
    yield PhysicsCheck(abs(arm) > float(data.wheel.r) + CLEAR_SDS * arm_sd, what, todo)


def _over_load(data: RigSet, values: np.ndarray, unit: str) -> np.ndarray:
    """Return forces divided by the wheel load, or torques and moments divided by load times radius (runs,).

    `unit` is the unit of `values` and selects the divisor.
    """
    return np.asarray(values / (data.load * (float(data.wheel.r) if unit == "N m" else 1.0)))


def _scale_name(unit: str) -> str:
    """Return the words for the divisor of a force or torque: "load times radius" for the unit N m, otherwise "load"."""
    return "load times radius" if unit == "N m" else "load"


def _read(data: RigSet, kind: type[RigChannel]) -> tuple[np.ndarray, np.ndarray]:
    """Return the values and the SDs of one channel of a rig in each run (runs,), with NaN in runs without a measured
    value.
    """
    for channel in data.channels:
        if isinstance(channel, kind):
            return channel.measured, np.where(channel.has_value, channel.sd, np.nan)
    return (nothing := np.full(data.slip.size, np.nan)), nothing


def _some(statistic: Callable[[np.ndarray], np.floating], values: np.ndarray) -> float:
    """Return a statistic, such as the median, of the finite values; NaN if no value is finite, so that no limit is
    exceeded.
    """
    measured = values[np.isfinite(values)]
    return float(statistic(measured)) if measured.size else float("nan")
