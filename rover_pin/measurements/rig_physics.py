"""Rig data against physics that holds for every wheel on every soil: wrong signs, units and radii.

Over a metre of the faster of both the rim goes `rim` and the wheel `travel` metres; T rim / r is then the work that the
motor puts in and f_t travel what the wheel gives out, and a soil gives no work.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from rover_pin.base.errors import DataError
from rover_pin.estimation.profile import CLEAR
from rover_pin.measurements.channel import DrawbarPull, RigChannel, SideForce, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import RigSet
from rover_pin.soil.slip import rim_and_travel

LOADS = (1e-4, 1e7)
"""Loads [N] that a wheel may carry. Why: from a gram-scale model's to a mining truck's."""
MOST_FORCE, EVER = 3.0, 100.0
"""Pull or torque / r over load that no median, no run, exceeds. Why: sand gives up to 0.7, lugs in clay about 1."""
MUCH_FORCE = {DrawbarPull: 1.0, Torque: 1.5}
"""The same from which it is named: sand gives up to 0.7, lugs in clay about 1."""
DRIVING, SLIPPING = 0.1, 0.3
"""Slips from which a wheel drives, and has sheared the soil under it. Why: radii are sure to some percent (assumed)."""
NO_TORQUE, LITTLE_TORQUE = 0.003, 0.01
"""torque / (r load) of a slipping wheel that no soil gives, and that is named. Why: a soil at its bearing limit of 5.1
c (Prandtl) still resists with c / (5.1 c) = 0.2; where k is ten times the contact it gives a tenth of that."""
GIVES_BACK = 1.5
"""Work given out over work put in that is impossible. Why: zero and radius explain some percent (assumed)."""
FINEST = 1e-12
"""Noise over the greatest value of a channel below which it is no measurement's. Why: no converter has 40 bits."""
LEAST_PULL = 0.02
"""Pull over load that is named where no run from little slip to much reaches it."""
SOFTEST, NARROWEST, STIFFEST = 1e5, 1e4, 1e9
"""Mean pressure over sinkage [Pa/m], and times the width [Pa], that are named where both are less, and the most. The
package's soils under wheels of 5 mm to 1 m and 1 N to 100 kN give 2e4 to 7e6 Pa/m, CMU's sand 3e5."""
MIN_TREND_RUNS, FALLING = 4, -0.7
"""Runs from which a trend is reported, and the rank correlation of pull with slip that is a fall."""
SLENDER = (0.05, 5.0)
"""Width over diameter of wheels: a bicycle's has 0.05, a road roller's 2."""


class Check(NamedTuple):
    """Whether a statistic of a set is beyond its limit, what is said then, and the remedy."""

    is_beyond: bool | np.bool_
    what: str
    todo: str
    column: str = ""
    "where it stands, of the points; empty where all of the set is meant"


def refuse_impossible(data: RigSet) -> None:
    """Refuse numbers that no wheel on any soil gives.

    Raises DataError: the first impossibility, and what may have caused it.
    """
    for check in _impossible(data):
        if check.is_beyond:
            raise DataError(f"{Finding(check.what, data.name, check.todo)}")


def suspicions(data: RigSet) -> list[Finding]:
    """Return what is possible and hardly meant."""
    checks = (*_of_units(data), *_of_pull(data), *_of_ground(data), *_of_arm(data))
    return [Finding(check.what, data.name, check.todo) for check in checks if check.is_beyond]


def _impossible(data: RigSet) -> Iterator[Check]:
    low, high = data.load.min(), data.load.max()
    what = f"load_N goes from {low:g} to {high:g} N, no wheel's"
    yield Check(not (low >= LOADS[0] and high <= LOADS[1]), what, f"give newtons, from {LOADS[0]:g} to {LOADS[1]:g}")
    for channel in data.channels:
        name, largest = channel.column, np.nanmax(np.abs(channel.measured), initial=1e-300)
        if not isinstance(channel, Sinkage):
            share, of = np.abs(_over_load(data, channel.measured, channel.unit)), _of(channel.unit)
            median, row = float(np.nanmedian(share)), int(np.nanargmax(share))
            what = f"{name} is {median:.3g} times the {of}, more than any soil gives"
            yield Check(median > MOST_FORCE, what, f"check the units of {name} and load_N")
            what = f"{name} is {share[row]:.3g} times the {of} in row {row + 1}"
            yield Check(share[row] > EVER, what, "mend or remove that row")
        finest = float(np.min(channel.sd / largest))
        what = f"the noise of {name} is {finest:.2g} of what was measured, no sensor's"
        yield Check(finest < FINEST, what, "state the SD of one run, from repeats")
    yield from _signs(data)
    yield from _work(data)


def _signs(data: RigSet) -> Iterator[Check]:
    """Yield whether channels are upside down: down, forwards and driving are positive."""
    every = np.ones(data.slip.size, dtype=bool)
    for kind, use, sign, when, positive in (
        (Sinkage, every, 1.0, "", "down"),
        (Torque, data.slip > DRIVING, 1.0, f" at slips above {DRIVING:g}, where the wheel drives", "driving"),
        (DrawbarPull, data.slip < -DRIVING, -1.0, f" at slips below {-DRIVING:g}, where the wheel brakes", "forwards"),
    ):
        measured, sd = _read(data, kind)
        median, word = _some(np.median, measured[use]), "negative" if sign > 0.0 else "positive"
        what = f"{kind.column} is {word}{when} ({median:.3g} in the median)"
        yield Check(
            sign * median < -CLEAR * _some(np.median, sd[use]), what, f"multiply it by -1: positive is {positive}"
        )


def _work(data: RigSet) -> Iterator[Check]:
    """Yield whether torques are too small for the pull, or for any soil."""
    put_in, out, _ = work(data)
    drives = (data.slip > DRIVING) & (out > 0.0) & np.isfinite(put_in)
    work_in, work_out = _some(np.median, put_in[drives]), _some(np.median, out[drives])
    times = work_out / work_in if work_in > 0.0 else np.inf
    what = f"the driving wheel gives out {times:.3g} times the work that its torque puts in, in the median"
    todo = "check the units of torque_Nm and drawbar_pull_N, and the wheel's r"
    yield Check(work_out > GIVES_BACK * work_in, what, todo)
    yield _little_torque(data, NO_TORQUE)


def work(data: RigSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the work put in, given out, and the SD of their difference, over the way of rim or wheel [J/m].

    NaN is where torque or pull was not measured.
    """
    (torque, torque_sd), (pull, pull_sd), r = _read(data, Torque), _read(data, DrawbarPull), float(data.wheel.r)
    rim, travel = rim_and_travel(data.slip)
    return torque / r * rim, pull * travel, np.hypot(torque_sd / r * rim, pull_sd * travel)


def _little_torque(data: RigSet, limit: float) -> Check:
    share = _some(np.median, _over_load(data, _read(data, Torque)[0], "N m")[data.slip > SLIPPING])
    what = f"torque_Nm at slips above {SLIPPING:g} is {share:.2g} times load times radius, less than any soil gives"
    return Check(share < limit, what, "check the units of torque_Nm and load_N, and the wheel's r")


def _of_units(data: RigSet) -> Iterator[Check]:
    slender = float(data.wheel.b) / (2.0 * float(data.wheel.r))
    what = f"the wheel is {slender:.2g} times as wide as high"
    yield Check(not SLENDER[0] <= slender <= SLENDER[1], what, "check r and b of [wheel], and their units")
    for kind, limit in MUCH_FORCE.items():
        share = _some(np.median, _over_load(data, _read(data, kind)[0], kind.unit)[data.slip > DRIVING])
        what = f"{kind.column} is {share:.3g} times the {_of(kind.unit)} in the median, more than sand gives"
        yield Check(share > limit, what, "see whether load_N is in kg, or a sensor carries an offset")
    yield _little_torque(data, LITTLE_TORQUE)


def _of_pull(data: RigSet) -> Iterator[Check]:
    put_in, out, sd = work(data)
    gains = (data.slip > DRIVING) & (out - put_in > CLEAR * sd)
    what = f"{int(gains.sum())} of {gains.size} runs give out more work than their torque puts in"
    yield Check(gains.any(), what, "a torque sensor's zero, or the wheel's r, is off")
    yield from _falling_pull(data)
    most, span = _some(np.max, np.abs(_over_load(data, _read(data, DrawbarPull)[0], "N"))), np.ptp(data.slip)
    what = f"drawbar_pull_N is never more than {most:.2g} of the load, at slips {span:.2g} apart"
    yield Check(span > SLIPPING and most < LEAST_PULL, what, "soil gives a tenth and more: check the units of both")


def _falling_pull(data: RigSet) -> Iterator[Check]:
    """Yield whether the pull falls with slip until it drags, as one with its sign turned does."""
    pull, sd = _read(data, DrawbarPull)
    use = np.flatnonzero((data.slip > -DRIVING) & np.isfinite(pull))
    if use.size < MIN_TREND_RUNS or np.ptp(data.slip[use]) < SLIPPING:
        return
    order = use[np.argsort(data.slip[use])]
    low, high = (float(np.median(pull[part])) for part in (order[: use.size // 3], order[-(use.size // 3) :]))
    falls = spearmanr(data.slip[order], pull[order]).statistic < FALLING
    what = f"drawbar_pull_N falls with slip, from {low:.3g} to {high:.3g} N"
    todo = "it looks upside down: positive is forwards, and slip helps before it digs"
    yield Check(falls and high < -CLEAR * float(np.median(sd[use])), what, todo)


def _of_ground(data: RigSet) -> Iterator[Check]:
    """Yield whether a soil is far too soft or stiff for the load: mean pressure under the arc over sinkage."""
    sunk, sd = _read(data, Sinkage)
    use = sunk > np.maximum(CLEAR * sd, 0.0)
    r, b, h = float(data.wheel.r), float(data.wheel.b), sunk[use]
    chord = np.sqrt(2.0 * r * h)
    stiffness = _some(np.median, data.load[use] / (b * chord * h))
    soft = stiffness < SOFTEST and b * stiffness < NARROWEST
    what = f"pressure over sinkage is {stiffness:.2g} Pa/m, {'softer than loose sand' if soft else 'stiffer than clay'}"
    todo = "check load_N (newtons, not kg), sinkage_m, and r and b of [wheel]"
    yield Check(soft or stiffness > STIFFEST, what, todo)


def _of_arm(data: RigSet) -> Iterator[Check]:
    """Yield whether a moment about the vertical has its side force beyond the wheel."""
    (moment, moment_sd), (side, side_sd) = _read(data, VerticalMoment), _read(data, SideForce)
    use = np.isfinite(moment) & data.askew & (np.abs(side) > CLEAR * side_sd)
    arm, sd = (_some(np.median, ratio) for ratio in (moment[use] / side[use], moment_sd[use] / np.abs(side[use])))
    where = "ahead of" if arm > 0.0 else "behind"
    what = f"by {VerticalMoment.column} the side force acts {abs(arm):.3g} m {where} the axle, beyond the rim"
    todo = "take it about the wheel's centre, or state moment_arm in [rig]; check its unit"
    yield Check(abs(arm) > float(data.wheel.r) + CLEAR * sd, what, todo)


def _over_load(data: RigSet, values: np.ndarray, unit: str) -> np.ndarray:
    """Return a force over the load, a torque or moment over load times radius (runs,)."""
    return np.asarray(values / (data.load * (float(data.wheel.r) if unit == "N m" else 1.0)))


def _of(unit: str) -> str:
    return "load times radius" if unit == "N m" else "load"


def _read(data: RigSet, kind: type[RigChannel]) -> tuple[np.ndarray, np.ndarray]:
    """Return what a channel measured and its SDs (runs,), NaN where nothing was."""
    for channel in data.channels:
        if isinstance(channel, kind):
            return channel.measured, np.where(channel.has_value, channel.sd, np.nan)
    return (nothing := np.full(data.slip.size, np.nan)), nothing


def _some(statistic: Callable[[np.ndarray], np.floating], values: np.ndarray) -> float:
    """Return a statistic of the values that there are; NaN, beyond no limit, where there are none."""
    measured = values[np.isfinite(values)]
    return float(statistic(measured)) if measured.size else float("nan")
