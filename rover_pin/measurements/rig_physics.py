"""Rig data against physics that holds for every wheel on every soil: wrong signs, units and radii.

Over a metre of the faster of both the rim goes `rim` and the wheel `travel` metres; T rim / r is then the work that the
motor puts in and f_t travel what the wheel gives out, and a soil gives no work.
"""

from collections.abc import Iterator

import numpy as np
from scipy.stats import spearmanr

from rover_pin.base.errors import DataError
from rover_pin.estimation.profile import CLEAR
from rover_pin.measurements.channel import DrawbarPull, RigChannel, SideForce, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import RigSet

LOADS = (1e-4, 1e7)
"""Loads [N] that a wheel may carry: from a gram-scale model's to a mining truck's."""
MOST_FORCE, EVER = 3.0, 100.0
"""Pull or torque / r over load that no soil gives in the median; that no single run gives."""
MUCH_FORCE = {DrawbarPull: 1.0, Torque: 1.5}
"""The same from which it is named: sand gives up to 0.7, lugs in clay about 1."""
DRIVING, SLIPPING = 0.1, 0.3
"""Slips from which a wheel drives beyond doubt about its radius; and has sheared the soil under it."""
NO_TORQUE, LITTLE_TORQUE = 0.003, 0.01
"""torque / (r load) of a slipping wheel that no soil gives, and that is named. A soil at its bearing limit of 5.1 c
(Prandtl) still resists with c / (5.1 c) = 0.2; where k is ten times the contact it gives a tenth of that."""
GIVES_BACK = 1.5
"""Work given out over work put in that is impossible beyond doubt; any excess beyond the noise is named."""
FINEST = 1e-12
"""Noise over the greatest value of a channel below which it is no measurement's."""
LEAST_PULL = 0.02
"""Pull over load that is named where no run from little slip to much reaches it."""
SOFTEST, NARROWEST, STIFFEST = 1e5, 1e4, 1e9
"""Mean pressure over sinkage [Pa/m], and times the width [Pa], that are named where both are less, and the most. The
package's soils under wheels of 5 mm to 1 m and 1 N to 100 kN give 2e4 to 7e6 Pa/m, CMU's sand 3e5."""
MIN_TREND_RUNS, FALLING = 4, -0.7
"""Runs from which a trend is reported, and the rank correlation of pull with slip that is a fall."""
SLENDER = (0.05, 5.0)
"""Width over diameter of wheels: a bicycle's has 0.05, a road roller's 2."""


def refuse_impossible(rig: RigSet) -> None:
    """Refuse numbers that no wheel on any soil gives.

    Raises DataError: the first impossibility, and what may have caused it.
    """
    for finding in _impossible(rig):
        raise DataError(f"{finding}")


def suspicions(rig: RigSet) -> list[Finding]:
    """Return what is possible and hardly meant."""
    return [*_units(rig), *_pulls(rig), *_ground(rig), *_arm(rig)]


def _impossible(rig: RigSet) -> Iterator[Finding]:
    load = rig.load
    if not (load.min() >= LOADS[0] and load.max() <= LOADS[1]):
        what = f"load_N goes from {load.min():g} to {load.max():g} N, no wheel's"
        yield Finding(what, rig.name, f"give newtons, from {LOADS[0]:g} to {LOADS[1]:g}")
    for channel in rig.channels:
        yield from _too_much(rig, channel)
        finest = float(np.min(channel.sd / np.nanmax(np.abs(channel.measured), initial=1e-300)))
        if finest < FINEST:
            what = f"the noise of {channel.column} is {finest:.2g} of what was measured, no sensor's"
            yield Finding(what, rig.name, "state the SD of one run, from repeats")
    yield from _signs(rig)
    yield from _work(rig)


def _too_much(rig: RigSet, channel: RigChannel) -> Iterator[Finding]:
    if isinstance(channel, Sinkage):
        return
    share = np.abs(_over_load(rig, channel))
    of = _of(channel)
    todo = f"check the units of {channel.column} and load_N"
    if np.nanmedian(share) > MOST_FORCE:
        yield Finding(f"{channel.column} is {np.nanmedian(share):.3g} times the {of}, more than any soil gives",
                      rig.name, todo)  # fmt: skip
    elif np.nanmax(share) > EVER:
        row = int(np.nanargmax(share)) + 1
        what = f"{channel.column} is {np.nanmax(share):.3g} times the {of} in row {row}"
        yield Finding(what, rig.name, "mend or remove that row")


def _signs(rig: RigSet) -> Iterator[Finding]:
    """Yield channels that are upside down: down, forwards and driving are positive."""
    every = np.ones(rig.slip.size, dtype=bool)
    for kind, use, sign, when, positive in (
        (Sinkage, every, 1.0, "", "down"),
        (Torque, rig.slip > DRIVING, 1.0, f" at slips above {DRIVING:g}, where the wheel drives", "driving"),
        (DrawbarPull, rig.slip < -DRIVING, -1.0, f" at slips below {-DRIVING:g}, where the wheel brakes", "forwards"),
    ):
        for channel in (candidate for candidate in rig.channels if isinstance(candidate, kind)):
            use = use & channel.has_value
            if use.any() and np.median(sign * channel.measured[use]) < -CLEAR * np.median(channel.sd[use]):
                word = "negative" if sign > 0.0 else "positive"
                what = f"{channel.column} is {word}{when} ({np.median(channel.measured[use]):.3g} in the median)"
                yield Finding(what, rig.name, f"multiply it by -1: positive is {positive}")


def _work(rig: RigSet) -> Iterator[Finding]:
    """Yield torques too small for the pull, or for any soil."""
    torque, pull = _channel(rig, Torque), _channel(rig, DrawbarPull)
    if torque is None:
        return
    use = (rig.slip > SLIPPING) & torque.has_value
    share = float(np.median(_over_load(rig, torque)[use])) if use.any() else np.inf
    if pull is not None:
        put_in, out, _ = work(rig, torque, pull)
        drives = (rig.slip > DRIVING) & (out > 0.0) & torque.has_value
        if drives.any() and np.median(out[drives]) > GIVES_BACK * np.median(put_in[drives]):
            times = f"gives out {np.median(out[drives]) / np.median(put_in[drives]):.3g} times the work that its"
            what = f"the driving wheel {times} torque puts in, in the median"
            yield Finding(what, rig.name, "check the units of torque_Nm and drawbar_pull_N, and the wheel's r")
            return
    if share < NO_TORQUE:
        yield _little_torque(rig, share)


def work(rig: RigSet, torque: RigChannel, pull: RigChannel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the work put in, given out, and the SD of their difference, over the way of rim or wheel [J/m]."""
    rim, travel = 1.0 + np.minimum(rig.slip, 0.0), 1.0 - np.maximum(rig.slip, 0.0)
    r = float(rig.wheel.r)
    sd = np.hypot(torque.sd / r * rim, pull.sd * travel)
    return torque.measured / r * rim, pull.measured * travel, sd


def _little_torque(rig: RigSet, share: float) -> Finding:
    what = f"torque_Nm at slips above {SLIPPING:g} is {share:.2g} times load times radius, less than any soil gives"
    return Finding(what, rig.name, "check the units of torque_Nm and load_N, and the wheel's r")


def _units(rig: RigSet) -> Iterator[Finding]:
    wheel = rig.wheel
    slender = float(wheel.b) / (2.0 * float(wheel.r))
    if not SLENDER[0] <= slender <= SLENDER[1]:
        what = f"the wheel is {slender:.2g} times as wide as high"
        yield Finding(what, rig.name, "check r and b of [wheel], and their units")
    for channel in (candidate for candidate in rig.channels if type(candidate) in MUCH_FORCE):
        use = (rig.slip > DRIVING) & channel.has_value
        if not use.any():
            continue
        share = float(np.median(_over_load(rig, channel)[use]))
        if share > MUCH_FORCE[type(channel)]:
            what = f"{channel.column} is {share:.3g} times the {_of(channel)} in the median, more than sand gives"
            yield Finding(what, rig.name, "see whether load_N is in kg, or a sensor carries an offset")
    torque = _channel(rig, Torque)
    slipping = (rig.slip > SLIPPING) & torque.has_value if torque is not None else np.zeros(1, dtype=bool)
    if torque is not None and slipping.any():
        share = float(np.median(_over_load(rig, torque)[slipping]))
        if share < LITTLE_TORQUE:
            yield _little_torque(rig, share)


def _pulls(rig: RigSet) -> Iterator[Finding]:
    pull, torque = _channel(rig, DrawbarPull), _channel(rig, Torque)
    if pull is None:
        return
    if torque is not None:
        put_in, out, sd = work(rig, torque, pull)
        gains = (rig.slip > DRIVING) & (out - put_in > CLEAR * sd)
        if gains.any():
            what = f"{int(gains.sum())} of {gains.size} runs give out more work than their torque puts in"
            yield Finding(what, rig.name, "a torque sensor's zero, or the wheel's r, is off")
    yield from _falling_pull(rig, pull)
    most = float(np.nanmax(np.abs(_over_load(rig, pull))))
    if np.ptp(rig.slip) > SLIPPING and most < LEAST_PULL:
        what = f"drawbar_pull_N is never more than {most:.2g} of the load, at slips {np.ptp(rig.slip):.2g} apart"
        yield Finding(what, rig.name, "soil gives a tenth and more: check the units of both")


def _falling_pull(rig: RigSet, pull: RigChannel) -> Iterator[Finding]:
    """Yield a pull that falls with slip until it drags, as one with its sign turned does."""
    use = np.flatnonzero((rig.slip > -DRIVING) & pull.has_value)
    if use.size < MIN_TREND_RUNS or np.ptp(rig.slip[use]) < SLIPPING:
        return
    order = use[np.argsort(rig.slip[use])]
    low, high = (float(np.median(pull.measured[part])) for part in (order[: use.size // 3], order[-(use.size // 3) :]))
    falls = spearmanr(rig.slip[order], pull.measured[order]).statistic < FALLING
    if falls and high < -CLEAR * float(np.median(pull.sd[use])):
        what = f"drawbar_pull_N falls with slip, from {low:.3g} to {high:.3g} N"
        yield Finding(what, rig.name, "it looks upside down: positive is forwards, and slip helps before it digs")


def _ground(rig: RigSet) -> Iterator[Finding]:
    """Yield a soil that is far too soft or stiff for the load: mean pressure under the arc over sinkage."""
    sunk = _channel(rig, Sinkage)
    if sunk is None:
        return
    use = sunk.measured > np.maximum(CLEAR * sunk.sd, 0.0)
    if not use.any():
        return
    r, b, h = float(rig.wheel.r), float(rig.wheel.b), sunk.measured[use]
    chord = np.sqrt(2.0 * r * h)
    stiffness = float(np.median(rig.load[use] / (b * chord * h)))
    soft = stiffness < SOFTEST and b * stiffness < NARROWEST
    if soft or stiffness > STIFFEST:
        word = "softer than loose sand" if soft else "stiffer than clay"
        what = f"pressure over sinkage is {stiffness:.2g} Pa/m, {word}"
        yield Finding(what, rig.name, "check load_N (newtons, not kg), sinkage_m, and r and b of [wheel]")


def _arm(rig: RigSet) -> Iterator[Finding]:
    """Yield a moment about the vertical whose side force would stand beyond the wheel."""
    moment, side = _channel(rig, VerticalMoment), _channel(rig, SideForce)
    if moment is None or side is None:
        return
    use = moment.has_value & side.has_value & rig.askew & (np.abs(side.measured) > CLEAR * side.sd)
    if not use.any():
        return
    force = side.measured[use]
    arm, sd = (float(np.median(ratio)) for ratio in (moment.measured[use] / force, moment.sd[use] / np.abs(force)))
    if abs(arm) > float(rig.wheel.r) + CLEAR * sd:
        where = "ahead of" if arm > 0.0 else "behind"
        what = f"by {VerticalMoment.column} the side force acts {abs(arm):.3g} m {where} the axle, beyond the rim"
        yield Finding(what, rig.name, "take it about the wheel's centre, or state moment_arm in [rig]; check its unit")


def _over_load(rig: RigSet, channel: RigChannel) -> np.ndarray:
    """Return a force over the load, a torque or moment over load times radius (runs,)."""
    arm = float(rig.wheel.r) if channel.unit == "N m" else 1.0
    return np.asarray(channel.measured / (rig.load * arm))


def _of(channel: RigChannel) -> str:
    return "load times radius" if channel.unit == "N m" else "load"


def _channel(rig: RigSet, kind: type[RigChannel]) -> RigChannel | None:
    return next((channel for channel in rig.channels if isinstance(channel, kind)), None)
