"""The outcome of a drive in one sentence: whether the rover drives on, turns, is stuck, stalled, slid back or held, and
since when.

Lengths are compared with the wheel radius r and with the distance that the rims have turned, times with the drive's
duration, so that the outcome does not depend on the size of the rover. Distances are positive in the direction of the
duty: a rover that is driven backwards covers a positive distance if it moves backwards.
"""

import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.outcome.audit import radii_of
from rover_pin.simulation.trace.trace import Trace

MIN_TRAVEL_RATIO = 0.1
"""Smallest ratio of travelled distance to rim distance of a rover that is not stuck. The ratio 0.1 is the slip S = 0.9,
at which a wheel hardly travels and digs itself in (assumed)."""
MIN_SPEED_SHARE = 0.05
"""Smallest ratio of the motors' mechanical work to their electric energy at which they do not count as stalled
(assumed). The ratio is about the wheels' speed divided by their speed without load, so that stalled motors turn at less
than 5 % of this speed."""
STILL_SHARE = 0.1
"""Smallest ratio of the rover's displacement to the wheel radius at which the rover counts as moving (assumed). Smaller
displacements come from the suspension and from wheels that settle."""
MIN_CROSSINGS = 4
"""Smallest mean number of changes of direction of a wheel, in the later half of a drive, at which the wheels count as
swinging to and fro. Four changes are two full swings; a rover that reverses once or that rolls back has fewer."""
NO_DUTY = 1e-9
"""Largest absolute duty of a motor that counts as not driven. The duties of a servo at rest are not exactly 0 because
of round-off."""
HELD_SINCE = "stands_since"
"""Name of an attribute of a trace: the time [s] since which a controller holds the wheels still, because the rover has
reached its aim."""
ON_THE_SPOT = 0.2
"""Limit with two uses (assumed). The rover counts as turning on the spot if the body's path, divided by the wheels'
travel, is below this number. The outcome mentions that the rover slides sideways if the sideways motion, divided by the
travel, is above this number."""


class DriveOutcome(NamedTuple):
    """The outcome of a drive: its type, the time since which it holds, and a sentence for the user."""

    kind: str
    """type of the outcome: driving, rocking, creeping, sliding, stuck, stalled, slid back, held, slid, stopped, or
    ended (`drive_outcome` explains these words)"""
    since: float
    """time [s] at which this outcome began; NaN if it holds from the start of the drive"""
    sentence: str


class WheelPaths(NamedTuple):
    """Distances that rims and wheels have covered since the start, at each of the T rows of a drive. All distances are
    means over the wheels.
    """

    t: np.ndarray
    """(T,) times of the rows [s]"""
    turned: np.ndarray
    """(T,) distance that the rims have turned, forwards or backwards [m]; it never decreases"""
    travelled: np.ndarray
    """(T,) distance that the wheels' centres have moved, positive in the direction of their duty [m]"""
    driven: np.ndarray
    """(T,) whether at least one motor is driven (its duty is not 0)"""
    r: float
    "mean wheel radius [m]"


def drive_outcome(trace: Trace) -> DriveOutcome | None:
    """Return the outcome of a drive, or None if the trace lacks channels that are needed for it, such as the wheels'
    travel, which no sensor measures.

    The outcomes are tested in this order, and the first that holds is returned:

    - ended: a failure stopped the drive before its time, as `attrs["stop"]` states;
    - slid back: at the end, the rover is more than one wheel radius behind the furthest position that it reached in the
      direction of its duty, or moves back;
    - stopped: the motors are not driven at the end, or a controller that has reached its aim holds the wheels still;
    - rocking: over the later half, the wheels swing to and fro, and less than half of their motion moves the rover on;
    - stalled: over the last tenth of the drive the motors are driven, but turn at less than 5 % of their speed without
      load, and no rim moves by a tenth of the wheel radius r; for wheels that creep, the sentence states their speed as
      a fraction of the speed without load;
    - held, slid: the motors were never driven, and the rover moved by less than r / 10 (held) or by more (slid); the
      outcome is also held if the motors were driven but the rover moved by less than r / 10;
    - sliding: over the last twentieth of the drive, the body moves further sideways than its wheels travel;
    - stuck: at the end, while the rims turn by one wheel radius, the wheels travel less than a tenth of this distance;
    - creeping, driving: all other drives; the wheels travel less than half of the distance that the rims turn
      (creeping), or more (driving). The sentence states that the rover turns on the spot if the body's path is less
      than a fifth of the wheels' path.
    """
    needed = [f"{name}_{wheel}" for name in ("wheel_rate", "travel", "duty") for wheel in trace.wheels]
    # Nothing can be said about a trace without these channels.
    if not {*needed, "body_x", "body_y", "energy_motor", "energy_electric"} <= trace.channels.keys():
        return None
    # A drive that ended early has its own reason, which is the outcome.
    if str(trace.attrs.get("stop", "duration")) != "duration":
        return DriveOutcome("ended", float(trace.t[-1]), f"{trace.attrs['stop']}, {_place(trace)}")
    if len(trace.t) < 2 or not trace.wheels or not np.all(radii_of(trace) > 0.0):
        return None
    paths = wheel_paths(trace)
    # A drive that was never driven is held or slid.
    if not np.any(paths.driven):
        distance = _furthest(trace)
        _, swing = _swing(trace, paths)
        swing = swing and f"; {swing}"
        if distance < STILL_SHARE * paths.r:
            text = f"held: not driven, and moved by only {1e3 * distance:.2g} mm{swing}"
            return DriveOutcome("held", math.nan, text)
        direction = "forwards" if paths.travelled[-1] > 0.0 else "back"
        text = f"slid {direction} by {_length(distance)} without being driven, {_place(trace)}{swing}"
        return DriveOutcome("slid", math.nan, text)
    # For all other drives, the first condition that holds decides.
    for judge in (_slid_back, _stopped, _rocking, _stalled, _barely_moved, _sliding, _stuck):
        outcome = judge(trace, paths)
        if outcome is not None:
            return outcome
    # No other outcome holds: the rover moves on or turns on the spot, or slowly moves against its duty.
    ratio = _travel_ratio(paths)
    last = float(ratio[-1]) if ratio.size else 1.0
    kind, verb = ("driving", "drives on") if last >= 0.5 else ("creeping", "creeps on")
    place = f"{_place(trace)}{_turn_text(trace)}"
    # The rover turns on the spot if, over the last twentieth, the body's path is short compared with the wheels'.
    begin = -1 - max(1, len(paths.t) // 20)
    path = float(np.sum(np.hypot(*(np.diff(trace[name][begin:]) for name in ("body_x", "body_y")))))
    on_the_spot = path <= ON_THE_SPOT * abs(float(paths.travelled[-1] - paths.travelled[begin]))
    if on_the_spot and _turn_text(trace):
        turn = math.degrees(float(trace["body_yaw"][-1] - trace["body_yaw"][begin]))
        rate = turn / float(paths.t[-1] - paths.t[begin])
        if rate:
            sense, slipping = "left" if rate > 0.0 else "right", "" if kind == "driving" else ", its wheels slip much"
            text = f"turns {sense} on the spot at {abs(rate):.2g} deg/s{slipping}, {place}"
            return DriveOutcome(kind, math.nan, text)
    time, travel, sideways = _late_motion(trace, paths)
    across = f", sliding sideways at {sideways / time:.2g} m/s" if sideways > ON_THE_SPOT * abs(travel) else ""
    # Slower than `_slid_back` requires, the rover moves against its duty.
    if travel < 0.0:
        kind, verb, travel = "slid back", "slides back, against its duty,", -travel
    return DriveOutcome(kind, math.nan, f"{verb} at {travel / time:.2g} m/s{across}, {place}")


def wheel_paths(trace: Trace) -> WheelPaths:
    """Return the distances that rims and wheels have covered at each row of a drive."""
    r = radii_of(trace)
    duty, dt = trace.stack("duty"), np.diff(trace.t, prepend=trace.t[:1])[:, None]
    # The sense of a wheel is the sign of its duty; in a pause that of the last duty, and 1 before the first.
    sign = np.sign(duty)
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign))[:, None], -1), axis=0)
    sense = np.where(last < 0, 1.0, np.take_along_axis(sign, np.maximum(last, 0), axis=0))
    rims, travel = sense * r * trace.stack("wheel_rate"), sense * trace.stack("travel")
    turned, travelled = (np.cumsum(np.mean(speed * dt, axis=1)) for speed in (np.abs(rims), travel))
    driven = np.any(np.abs(duty) > NO_DUTY, axis=1) & (trace.t <= float(trace.attrs.get(HELD_SINCE, math.inf)))
    return WheelPaths(trace.t, turned, travelled, driven, float(np.mean(r)))


def _furthest(trace: Trace) -> float:
    """Return the largest horizontal distance of the body from its position in the first row [m]."""
    return float(np.max(np.hypot(*(trace[name] - trace[name][0] for name in ("body_x", "body_y")))))


def _swing(trace: Trace, paths: WheelPaths) -> tuple[float, str]:
    """Return the frequency [Hz] at which the wheels swing to and fro in the later half of a drive, and a text about
    this motion.

    The frequency is 0 if the wheels do not swing. The text is empty unless less than half of the wheels' motion moves
    the rover on. Reason for such a motion under a constant duty: if the traction factor of the soil at zero slip
    exceeds the motion resistance, F(0) > R, the soil drives wheels at rest, so that no state of rest is stable.
    """
    # Net distance of the rims, and number of changes of direction, both as means over the wheels.
    late = slice(len(paths.t) // 2, None)
    t, rates, signs = paths.t[late], trace.stack("wheel_rate")[late], np.sign(trace.stack("duty")[late])
    net = paths.r * float(np.mean(np.abs(np.trapezoid(rates, t, axis=0))))
    crossings = float(np.mean(np.sum(np.diff(np.sign(rates), axis=0) != 0.0, axis=0)))
    if crossings < MIN_CROSSINGS:
        return 0.0, ""
    to_and_fro, rate = float(paths.turned[-1] - paths.turned[late][0]), 0.5 * crossings / float(t[-1] - t[0])
    if to_and_fro < STILL_SHARE * paths.r or net > 0.5 * to_and_fro:
        return rate, ""
    # A controller that changes the sign of its duty may cause the swing itself.
    why = ", which the soil drives: F(0) > R" if np.all(signs == signs[0]) else ""
    return rate, f"its wheels swing to and fro at {rate:.1f} Hz{why}"


def _rocking(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "rocking" if the wheels swing to and fro in the later half of the drive; otherwise None."""
    _, swing = _swing(trace, paths)
    if not swing:
        return None
    time, travel, _ = _late_motion(trace, paths)
    text = f"{swing}; on average it moves at {abs(travel) / time:.2g} m/s, {_place(trace)}{_turn_text(trace)}"
    return DriveOutcome("rocking", math.nan, text)


def _slid_back(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "slid back" if the drive ends more than one wheel radius behind the furthest position that the
    rover reached; otherwise None.
    """
    # Distances are positive in the direction of the duty, so that the largest one is the furthest position.
    furthest = int(np.argmax(paths.travelled))
    back = float(paths.travelled[furthest] - paths.travelled[-1])
    if back < paths.r:
        return None
    when = _since(paths, furthest)
    return DriveOutcome("slid back", float(paths.t[furthest]), f"slid back by {_length(back)} {when}, {_place(trace)}")


def _stopped(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "stopped" if the motors are not driven at the end of the drive, or if a controller holds the
    wheels still; otherwise None.
    """
    if paths.driven[-1]:
        return None
    end = int(np.flatnonzero(paths.driven)[-1]) + 1
    after, how = float(paths.travelled[-1] - paths.travelled[end]), "not driven"
    if HELD_SINCE in trace.attrs:
        how = "held still"
    text = f"{how} since {paths.t[end]:.1f} s, then moved on by {_length(after)}, {_place(trace)}"
    return DriveOutcome("stopped", float(paths.t[end]), text)


def _stalled(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "stalled", with the time at which it began, if the motors stall over the last tenth of the
    drive; otherwise None.
    """
    # Over each window of a tenth of the drive: work of the motors, energy from the supply, distance of the rims.
    window = max(2, len(paths.t) // 10)
    mechanical, electric = (
        trace[name][window:] - trace[name][:-window] for name in ("energy_motor", "energy_electric")
    )
    rolled = paths.turned[window:] - paths.turned[:-window]
    stalls = (np.abs(mechanical) < MIN_SPEED_SHARE * electric) & (rolled < STILL_SHARE * paths.r)
    if not stalls.size or not stalls[-1]:
        return None
    # The stall began where the last unbroken run of stalled windows begins.
    first = _last_stretch(stalls)
    since, duty = _since(paths, first), float(np.mean(np.abs(trace.stack("duty")[-1])))
    crept = float(paths.turned[-1] - paths.turned[first])
    # Wheels that creep for long cover some distance, and are reported with their speed.
    if crept < STILL_SHARE * paths.r:
        text = f"stalled {since}: no wheel turns at a duty of {duty:.2g}"
    else:
        given, drawn = (float(trace[name][-1] - trace[name][first]) for name in ("energy_motor", "energy_electric"))
        pace, share = 1e3 * crept / float(paths.t[-1] - paths.t[first]), 100.0 * abs(given) / drawn
        text = (
            f"nearly stalled {since}: the wheels creep at {pace:.2g} mm/s, {share:.2g} % of their speed without a "
            f"load at a duty of {duty:.2g}"
        )
    return DriveOutcome("stalled", float(paths.t[first]), f"{text}, {_place(trace)}{_turn_text(trace)}")


def _barely_moved(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "held" if the motors were driven, but neither the body nor the rims moved by a tenth of the
    wheel radius; otherwise None.
    """
    distance = _furthest(trace)
    if max(distance, paths.turned[-1]) >= STILL_SHARE * paths.r:
        return None
    duty = float(np.mean(np.abs(trace.stack("duty")[-1])))
    return DriveOutcome(
        "held", math.nan, f"moved by {1e3 * distance:.2g} mm in {trace.t[-1]:.2g} s at a duty of {duty:.2g}"
    )


def _late_motion(trace: Trace, paths: WheelPaths) -> tuple[float, float, float]:
    """Return the rover's motion near the end of a drive as three numbers: a duration [s], the distance that the wheels
    travel in it [m], and the distance that the body moves sideways in it [m].

    The duration is the last twentieth of the drive. In a turn the wheels travel further than the body; the travel is
    then limited to the body's path. The sideways distance is the displacement across the body's heading, but not more
    than sqrt(body^2 - travel^2), because steered wheels travel across the heading too, without sliding.

    If the wheels swing to and fro, a twentieth may contain a single swing. The result is then the body's mean motion in
    1 s, averaged over the later half of the drive, and a sideways distance of 0.
    """
    # Displacement and heading of the body since the beginning of the window.
    swings = _swing(trace, paths)[0] > 0.0
    row = -1 - max(1, len(paths.t) // (2 if swings else 20))
    x, y = (float(trace[name][-1] - trace[name][row]) for name in ("body_x", "body_y"))
    yaw = float(np.mean(trace["body_yaw"][row:])) if "body_yaw" in trace else math.atan2(y, x)
    travel = float(paths.travelled[-1] - paths.travelled[row])
    if swings:
        slopes = (np.polyfit(paths.t[row:], trace[name][row:], 1)[0] for name in ("body_x", "body_y"))
        return 1.0, math.copysign(math.hypot(*slopes), travel), 0.0
    # Path of the body, uphill and downhill included.
    places = np.stack([trace[name][row:] for name in ("body_x", "body_y", "body_z") if name in trace])
    body = float(np.sum(np.linalg.norm(np.diff(places), axis=0)))
    travel = math.copysign(min(abs(travel), body), travel)
    across = abs(y * math.cos(yaw) - x * math.sin(yaw))
    return float(paths.t[-1] - paths.t[row]), travel, min(across, math.sqrt(max(x**2 + y**2 - travel**2, 0.0)))


def _sliding(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "sliding" if the body moves further sideways than its wheels travel, near the end of the
    drive; otherwise None.
    """
    time, travel, sideways = _late_motion(trace, paths)
    if sideways <= max(abs(travel), STILL_SHARE * paths.r):
        return None
    text = (
        f"slides sideways at {sideways / time:.2g} m/s, its wheels travel at {travel / time:.2g} m/s, {_place(trace)}"
    )
    return DriveOutcome("sliding", math.nan, text + _turn_text(trace))


def _stuck(trace: Trace, paths: WheelPaths) -> DriveOutcome | None:
    """Return the outcome "stuck", with the time at which it began, if the wheels travel less than a tenth of the
    distance that the rims turn; otherwise None.
    """
    ratio = _travel_ratio(paths)
    if not ratio.size or ratio[-1] >= MIN_TRAVEL_RATIO:
        return None
    first = _last_stretch(ratio < MIN_TRAVEL_RATIO)
    least = np.min(np.mean(trace.stack("slip")[first:], axis=0)) if f"slip_{trace.wheels[0]}" in trace else math.nan
    slips = f": all wheels above S = {math.floor(100 * least) / 100:g}" if least > 0.0 else ""
    return DriveOutcome("stuck", float(paths.t[first]), f"stuck {_place(trace)} {_since(paths, first)}{slips}")


def _travel_ratio(paths: WheelPaths) -> np.ndarray:
    """Return, for each row of a drive, the distance travelled while the rims turn by the next wheel radius r, divided
    by the distance that the rims turn in this time. Rows are omitted if the rims turn by less than r after them.
    """
    # Rims that have turned by 1e15 m lose r in round-off; the second condition keeps the distances positive.
    turned, r = paths.turned, paths.r
    begin = np.flatnonzero((turned <= turned[-1] - r) & (turned < turned[-1]))
    end = np.maximum(np.searchsorted(turned, turned[begin] + r), np.searchsorted(turned, turned[begin], side="right"))
    return (paths.travelled[end] - paths.travelled[begin]) / (turned[end] - turned[begin])


def _last_stretch(condition: np.ndarray) -> int:
    """Return the row at which the last unbroken run of True begins in `condition` (T,). The result is 0 if all values
    are True, and T if the last value is False.
    """
    false_rows = np.flatnonzero(~condition)
    return int(false_rows[-1]) + 1 if false_rows.size else 0


def _since(paths: WheelPaths, row: int) -> str:
    """Return the time since which an outcome holds, in words: "since 3.2 s", or "from the start" if `row`, at which the
    outcome begins, lies within the first fiftieth of the drive.
    """
    return "from the start" if row <= len(paths.t) // 50 else f"since {paths.t[row]:.1f} s"


def _place(trace: Trace) -> str:
    """Return the position at which a drive ends, in words, such as "at x = 1.20 m"."""
    x, y = (round(float(trace[name][-1]), 2) + 0.0 for name in ("body_x", "body_y"))
    return f"at x = {x:.2f} m" + (f", y = {y:.2f} m" if y else "")


def _turn_text(trace: Trace) -> str:
    """Return the change of the heading over the whole drive in words, such as ", turned by 30 deg"; an empty string if
    it does not exceed 5 deg.
    """
    turn = math.degrees(trace["body_yaw"][-1] - trace["body_yaw"][0]) if "body_yaw" in trace else 0.0
    return f", turned by {turn:.0f} deg" if abs(turn) > 5.0 else ""


def _length(length: float) -> str:
    """Return a length as a text, in mm if it is below half a metre, otherwise in m."""
    return f"{1e3 * length:.0f} mm" if abs(length) < 0.5 else f"{length:.2f} m"
