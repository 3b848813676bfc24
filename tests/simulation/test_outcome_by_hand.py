"""What a drive came to, on traces of constant speeds that lie just within and just beyond each limit of the words."""

import re

import numpy as np
import pytest

from rover_pin.simulation.outcome.outcome import drive_outcome
from rover_pin.simulation.trace.trace import Trace

R, COUNT = 0.1, 201
T = 0.1 * np.arange(COUNT)
LATE = T > 10.05


def trace(rate=1.0, travel=0.05, duty=0.5, gave=1.0, count=COUNT, attrs=None, **channels):
    """Two wheels of 10 cm radius for 20 s: rates [rad/s], travel [m/s], `gave` the mechanical of 1 W electric power."""
    t = T[:count]
    way = 0.1 * np.cumsum(np.resize(travel, count))
    usual = {"t_s": t, "body_x": way - way[0], "body_y": 0.0 * t, "body_yaw": 0.0 * t}
    usual |= {"energy_motor": gave * t, "energy_electric": t}
    for wheel, at in (("a", 0), ("b", -1)):
        for name, values in (("wheel_rate", rate), ("travel", travel), ("duty", duty)):
            own = values[at] if isinstance(values, tuple) else values
            usual[f"{name}_{wheel}"] = np.resize(np.asarray(own, dtype=float), count)
    given = {name: np.resize(np.asarray(values, dtype=float), count) for name, values in channels.items()}
    return Trace({**usual, **given}, attrs={"wheel_radii_m": [R, R], "wheels": ["a", "b"], **(attrs or {})})


def told(**given):
    found = drive_outcome(trace(**given))
    return found.kind, found.sentence


def numbers(sentence):
    """The numbers of a sentence, with their units and what they are of: "x = 1.00 m", "0.05 m/s"."""
    return re.findall(r"(?:[xyS] = )?-?\d[\d.]*(?: (?:mm/s|m/s|deg/s|deg|mm|m|s|%|Hz)(?![\w/]))?", sentence)


@pytest.mark.parametrize(
    ("travel", "kind"), [(0.0504, "driving"), (0.0495, "creeping"), (0.0101, "creeping"), (0.0099, "stuck")]
)
def test_half_of_rim_travel_is_driving_below_a_tenth_is_stuck(travel, kind):
    """The rims turn at 0.1 m/s, forwards or backwards as the duty asks."""
    for sign in (1.0, -1.0):
        found, said = told(rate=sign, travel=sign * travel, duty=0.5 * sign)
        assert found == kind
        place = f"x = {20.0 * sign * travel:.2f} m"
        assert numbers(said) == ([place] if kind == "stuck" else [f"{travel:.2g} m/s", place])


def test_stuck_begins_after_the_last_radius_with_some_travel():
    """At 5 mm/s of 100 mm/s since 10 s, at 50 mm/s before: 0.11 s before that a last radius begins with a tenth."""
    found = drive_outcome(trace(travel=np.where(LATE, 0.005, 0.05), slip_a=0.989, slip_b=0.962))
    assert found.kind == "stuck"
    assert found.since == pytest.approx(9.9), "one row at 50 mm/s and nine at 5 are 9.5 % of what the rims turn"
    assert numbers(found.sentence) == ["x = 0.55 m", "9.9 s", "S = 0.96"]
    assert drive_outcome(trace(travel=0.0)).since == 0.0, "from its first row on"
    halting = drive_outcome(trace(travel=np.where(T < 5.05, 0.0, np.where(LATE, 0.005, 0.05))))
    assert halting.since == found.since, "it was free in between"
    assert drive_outcome(trace(travel=0.0, slip_a=0.057, slip_b=0.9)).sentence.endswith("S = 0.05")
    assert "S =" not in drive_outcome(trace(travel=0.0, slip_a=-0.2, slip_b=0.9)).sentence
