"""What a drive came to, in one sentence: it drives on or turns, is stuck, stalled, slid back, or held, since when.

Lengths are in r and the rims' way, times in the drive's duration, for any rover; wheels in the sense they are driven.
"""

import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.outcome.audit import radii_of
from rover_pin.simulation.trace.trace import Trace

GRIP = 0.1
"""Travel over what the rims turn, from which on a rover moves: below it, all in all, S is above 0.9."""
SPEED_SHARE = 0.05
"""Mechanical over electric energy, which is the wheels' speed over that without a load, below which motors stall."""
SHORT = 0.1
"""Share of a wheel's radius that counts as standing still."""
LEAST_CROSSINGS = 4
"""Changes of a wheel's sense in the later half of a drive from which it swings."""
NO_DUTY, HELD = 1e-9, "stands_since"
"""Duty that is none, round-off of a servo that rests; and of a trace since when [s] servos hold the wheels still."""
ON_THE_SPOT = 0.2
"""Body's way over its wheels', below which it turns on the spot; its way aside over theirs, from which it is said."""


class DriveOutcome(NamedTuple):
    """What a drive came to; `since` [s] is NaN where it was so from the start."""

    kind: str
    "driving, rocking, creeping, sliding, stuck, stalled, slid back, held, slid, stopped, or ended"
    since: float
    sentence: str


class Ways(NamedTuple):
    """Rows (T,) of a drive: time [s], mean ways of rims and wheels in the driven sense [m], if driven; mean r [m]."""

    t: np.ndarray
    turned: np.ndarray
    travelled: np.ndarray
    driven: np.ndarray
    r: float


def drive_outcome(trace: Trace) -> DriveOutcome | None:
    """Return what a drive came to, or None where the trace has not the truth that it takes.

    - ended: stopped before its time, as `attrs["stop"]` says;
    - slid back: more than a radius behind the furthest place, in the sense of its duty, or going back at the end;
    - stalled: driven, but the motors turn at less than 5 % of their speed without a load, and no wheel by a tenth of r
      over the last tenth of the drive; that they creep is said with their share of that speed;
    - rocking: over the later half, its wheels swing to and fro, and less than half of that takes them on;
    - sliding: the body goes further aside than its wheels travel, over the last twentieth of the drive;
    - stuck: over every last radius that the rims turn, the wheels travel less than a tenth of it;
    - held, slid: never driven, and moved by less than r / 10, or by more; held also where driven, by less than r / 10;
    - stopped: no longer driven at the end, or held still by a control that has come to its end;
    - creeping, driving: the rest, the wheels travelling less than half of what they turn, or more; on the spot where
      the body's way is less than a fifth of the wheels'.
    """
    needed = [f"{name}_{wheel}" for name in ("wheel_rate", "travel", "duty") for wheel in trace.wheels]
    if not {*needed, "body_x", "body_y", "energy_motor", "energy_electric"} <= trace.channels.keys():
        return None
    if str(trace.attrs.get("stop", "duration")) != "duration":
        return DriveOutcome("ended", float(trace.t[-1]), f"{trace.attrs['stop']}, {_place(trace, -1)}")
    if len(trace.t) < 2 or not trace.wheels or not np.all(radii_of(trace) > 0.0):
        return None
    ways = ways_of(trace)
    if not np.any(ways.driven):
        return _parked_outcome(trace, ways)
    for judge in (_slid_back, _stopped_outcome, _rocking, _stalled_outcome, _barely_moved, _sliding, _stuck_outcome):
        outcome = judge(trace, ways)
        if outcome is not None:
            return outcome
    return _driving(trace, ways)


def ways_of(trace: Trace) -> Ways:
    """Return how far rims and wheels have come at each row."""
    r = radii_of(trace)
    duty, dt = trace.stack("duty"), np.diff(trace.t, prepend=trace.t[:1])[:, None]
    sense = _held_sense(duty)
    rims, travel = sense * r * trace.stack("wheel_rate"), sense * trace.stack("travel")
    turned, travelled = (np.cumsum(np.mean(speed * dt, axis=1)) for speed in (np.abs(rims), travel))
    driven = np.any(np.abs(duty) > NO_DUTY, axis=1) & (trace.t <= float(trace.attrs.get(HELD, math.inf)))
    return Ways(trace.t, turned, travelled, driven, float(np.mean(r)))


def _held_sense(duty: np.ndarray) -> np.ndarray:
    """Return the sign of each wheel's duty, through a pause that of before, 1 before the first."""
    sign = np.sign(duty)
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign))[:, None], -1), axis=0)
    last_sign = np.take_along_axis(sign, np.maximum(last, 0), axis=0)
    return np.where(last < 0, 1.0, last_sign)


def _furthest(trace: Trace) -> float:
    return float(np.max(np.hypot(*(trace[name] - trace[name][0] for name in ("body_x", "body_y")))))


def _parked_outcome(trace: Trace, ways: Ways) -> DriveOutcome:
    distance = _furthest(trace)
    _, swing = _swing(trace, ways)
    swing = swing and f"; {swing}"
    if distance < SHORT * ways.r:
        return DriveOutcome("held", math.nan, f"held: not driven, it stood still to {1e3 * distance:.2g} mm{swing}")
    way = "forwards" if ways.travelled[-1] > 0.0 else "back"
    return DriveOutcome(
        "slid", math.nan, f"slid {way} by {_length(distance)} without being driven, {_place(trace, -1)}{swing}"
    )


def _swing(trace: Trace, ways: Ways) -> tuple[float, str]:
    """Return at what rate [Hz] wheels swing in the later half of a drive, and in words if little of it takes them on.

    A soil whose traction at no slip exceeds the resistance, F(0) > R, drives wheels that stand: no rest is stable.
    """
    late = slice(len(ways.t) // 2, None)
    t, rates, signs = ways.t[late], trace.stack("wheel_rate")[late], np.sign(trace.stack("duty")[late])
    net = ways.r * float(np.mean(np.abs(np.trapezoid(rates, t, axis=0))))
    crossings = float(np.mean(np.sum(np.diff(np.sign(rates), axis=0) != 0.0, axis=0)))
    if crossings < LEAST_CROSSINGS:
        return 0.0, ""
    to_and_fro, rate = float(ways.turned[-1] - ways.turned[late][0]), 0.5 * crossings / float(t[-1] - t[0])
    if to_and_fro < SHORT * ways.r or net > 0.5 * to_and_fro:
        return rate, ""
    why = ", which the soil drives: F(0) > R" if np.all(signs == signs[0]) else ""
    return rate, f"its wheels swing to and fro at {rate:.1f} Hz{why}"


def _rocking(trace: Trace, ways: Ways) -> DriveOutcome | None:
    _, swinging = _swing(trace, ways)
    if not swinging:
        return None
    time, travel, _ = _aside(trace, ways)
    text = f"{swinging}; all in all it moves at {abs(travel) / time:.2g} m/s, {_place(trace, -1)}{_turn_text(trace)}"
    return DriveOutcome("rocking", math.nan, text)


def _slid_back(trace: Trace, ways: Ways) -> DriveOutcome | None:
    most = int(np.argmax(ways.travelled))
    back = float(ways.travelled[most] - ways.travelled[-1])
    if back < ways.r:
        return None
    when = _since(ways, most)
    return DriveOutcome("slid back", float(ways.t[most]), f"slid back by {_length(back)} {when}, {_place(trace, -1)}")


def _stopped_outcome(trace: Trace, ways: Ways) -> DriveOutcome | None:
    if ways.driven[-1]:
        return None
    off = int(np.flatnonzero(ways.driven)[-1]) + 1
    on, how = float(ways.travelled[-1] - ways.travelled[off]), "held still" if HELD in trace.attrs else "not driven"
    text = f"{how} since {ways.t[off]:.1f} s, it moved on by {_length(on)}, {_place(trace, -1)}"
    return DriveOutcome("stopped", float(ways.t[off]), text)


def _stalled_outcome(trace: Trace, ways: Ways) -> DriveOutcome | None:
    """Over the last tenth of the drive and as long before as it was so."""
    window = max(2, len(ways.t) // 10)
    gave, took = (trace[name][window:] - trace[name][:-window] for name in ("energy_motor", "energy_electric"))
    rolled = ways.turned[window:] - ways.turned[:-window]
    still = (np.abs(gave) < SPEED_SHARE * took) & (rolled < SHORT * ways.r)
    if not still.size or not still[-1]:
        return None
    first = _last_stretch(still)
    text = f"{_not_turning(trace, ways, first)}, {_place(trace, -1)}{_turn_text(trace)}"
    return DriveOutcome("stalled", float(ways.t[first]), text)


def _not_turning(trace: Trace, ways: Ways, first: int) -> str:
    """Return how far from turning the wheels are since this row: not at all, or at so much of what is asked."""
    since, duty = _since(ways, first), float(np.mean(np.abs(trace.stack("duty")[-1])))
    crept = float(ways.turned[-1] - ways.turned[first])
    if crept < SHORT * ways.r:
        return f"stalled {since}: no wheel turns at a duty of {duty:.2g}"
    gave, took = (float(trace[name][-1] - trace[name][first]) for name in ("energy_motor", "energy_electric"))
    pace, share = 1e3 * crept / float(ways.t[-1] - ways.t[first]), 100.0 * abs(gave) / took
    return (
        f"all but stalled {since}: the wheels creep at {pace:.2g} mm/s, {share:.2g} % of their speed without a load "
        f"at a duty of {duty:.2g}"
    )


def _barely_moved(trace: Trace, ways: Ways) -> DriveOutcome | None:
    distance = _furthest(trace)
    if max(distance, ways.turned[-1]) >= SHORT * ways.r:
        return None
    duty = float(np.mean(np.abs(trace.stack("duty")[-1])))
    return DriveOutcome(
        "held", math.nan, f"moved by {1e3 * distance:.2g} mm in {trace.t[-1]:.2g} s at a duty of {duty:.2g}"
    )


def _aside(trace: Trace, ways: Ways) -> tuple[float, float, float]:
    """Return the last twentieth of a drive [s], and what wheels travel and the body goes aside of that in it [m].

    Where wheels swing it is the body's mean way in 1 s over the later half: a twentieth takes the swing for the pace.
    Of a rover that turns wheels travel further than the body, which is what comes on.
    Aside is the body's way across its heading, but no more than aside^2 = body^2 - travel^2: wheels that are steered
    travel across the heading too, and do not slide.
    """
    swings = _swing(trace, ways)[0] > 0.0
    row = -1 - max(1, len(ways.t) // (2 if swings else 20))
    x, y = (float(trace[name][-1] - trace[name][row]) for name in ("body_x", "body_y"))
    yaw = float(np.mean(trace["body_yaw"][row:])) if "body_yaw" in trace else math.atan2(y, x)
    travel = float(ways.travelled[-1] - ways.travelled[row])
    if swings:
        slopes = (np.polyfit(ways.t[row:], trace[name][row:], 1)[0] for name in ("body_x", "body_y"))
        return 1.0, math.copysign(math.hypot(*slopes), travel), 0.0
    places = np.stack([trace[name][row:] for name in ("body_x", "body_y", "body_z") if name in trace])
    body = float(np.sum(np.linalg.norm(np.diff(places), axis=0)))
    travel = math.copysign(min(abs(travel), body), travel)
    across = abs(y * math.cos(yaw) - x * math.sin(yaw))
    return float(ways.t[-1] - ways.t[row]), travel, min(across, math.sqrt(max(x**2 + y**2 - travel**2, 0.0)))


def _sliding(trace: Trace, ways: Ways) -> DriveOutcome | None:
    time, travel, aside = _aside(trace, ways)
    if aside <= max(abs(travel), SHORT * ways.r):
        return None
    text = f"slides aside at {aside / time:.2g} m/s, its wheels travel at {travel / time:.2g} m/s, {_place(trace, -1)}"
    return DriveOutcome("sliding", math.nan, text + _turn_text(trace))


def _stuck_outcome(trace: Trace, ways: Ways) -> DriveOutcome | None:
    ratio = _grip(ways)
    if not ratio.size or ratio[-1] >= GRIP:
        return None
    first = _last_stretch(ratio < GRIP)
    least = np.min(np.mean(trace.stack("slip")[first:], axis=0)) if f"slip_{trace.wheels[0]}" in trace else math.nan
    tell = f": all wheels above S = {math.floor(100 * least) / 100:g}" if least > 0.0 else ""
    return DriveOutcome("stuck", float(ways.t[first]), f"stuck {_place(trace, -1)} {_since(ways, first)}{tell}")


def _driving(trace: Trace, ways: Ways) -> DriveOutcome:
    ratio = _grip(ways)
    last = float(ratio[-1]) if ratio.size else 1.0
    window = max(1, len(ways.t) // 20)
    time, travel, aside = _aside(trace, ways)
    kind, word = ("driving", "drives on") if last >= 0.5 else ("creeping", "creeps on")
    place = f"{_place(trace, -1)}{_turn_text(trace)}"
    rate = _rate_on_the_spot(trace, ways, window)
    if rate:
        sense, halting = "left" if rate > 0.0 else "right", "" if kind == "driving" else ", its wheels slip much"
        return DriveOutcome(kind, math.nan, f"turns {sense} on the spot at {abs(rate):.2g} deg/s{halting}, {place}")
    across = f", sliding aside at {aside / time:.2g} m/s" if aside > ON_THE_SPOT * abs(travel) else ""
    if travel < 0.0:
        kind, word, travel = "slid back", "slides back, against its duty,", -travel
    return DriveOutcome(kind, math.nan, f"{word} at {travel / time:.2g} m/s{across}, {place}")


def _rate_on_the_spot(trace: Trace, ways: Ways, window: int) -> float:
    """Return the yaw rate [deg/s] over the last `window` rows of a rover that turns on the spot, else 0."""
    if "body_yaw" not in trace or not _turn_text(trace):
        return 0.0
    x, y = (np.diff(trace[name][-1 - window :]) for name in ("body_x", "body_y"))
    wheels = abs(float(ways.travelled[-1] - ways.travelled[-1 - window]))
    if float(np.sum(np.hypot(x, y))) > ON_THE_SPOT * wheels:
        return 0.0
    turn = math.degrees(float(trace["body_yaw"][-1] - trace["body_yaw"][-1 - window]))
    return turn / float(ways.t[-1] - ways.t[-1 - window])


def _grip(ways: Ways) -> np.ndarray:
    """Return, for each row from which the rims still turn by r, what the wheels travel over that way."""
    turned, r = ways.turned, ways.r  # r is lost in the rounding of rims that turned by 1e15 m
    begin = np.flatnonzero((turned <= turned[-1] - r) & (turned < turned[-1]))
    end = np.maximum(np.searchsorted(turned, turned[begin] + r), np.searchsorted(turned, turned[begin], side="right"))
    return (ways.travelled[end] - ways.travelled[begin]) / (turned[end] - turned[begin])


def _last_stretch(so: np.ndarray) -> int:
    """Return where the last run of True begins."""
    otherwise = np.flatnonzero(~so)
    return int(otherwise[-1]) + 1 if otherwise.size else 0


def _since(ways: Ways, row: int) -> str:
    return "from the start" if row <= len(ways.t) // 50 else f"since {ways.t[row]:.1f} s"


def _place(trace: Trace, row: int) -> str:
    x, y = (round(float(trace[name][row]), 2) + 0.0 for name in ("body_x", "body_y"))
    return f"at x = {x:.2f} m" + (f", y = {y:.2f} m" if y else "")


def _turn_text(trace: Trace) -> str:
    turn = math.degrees(trace["body_yaw"][-1] - trace["body_yaw"][0]) if "body_yaw" in trace else 0.0
    return f", turned by {turn:.0f} deg" if abs(turn) > 5.0 else ""


def _length(length: float) -> str:
    return f"{1e3 * length:.0f} mm" if abs(length) < 0.5 else f"{length:.2f} m"
