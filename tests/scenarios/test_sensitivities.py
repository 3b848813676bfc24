"""Slopes of whole drives: exact where they are known, those of a difference of the eighth order on drawn drives."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.scenarios.scenario import scenario, settings_of
from rover_pin.scenarios.sensitivities import RELATIVE_WIDTH as WIDTH
from rover_pin.scenarios.sensitivities import course_of, drive_along, sensitivities

EIGHTH = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
"""Weights of f(p + i h) - f(p - i h), over h, whose error is of the eighth order."""
NEAR = 1e-6
GROUNDS = {"flat": (), "incline": ("terrain.angle",), "slope": (), "ditch": ("terrain.wall_angle", "terrain.depth"),
           "bump": ("terrain.height",), "hills": (), "rocks": ()}  # fmt: skip
NUMBERS = ("soil.k", "soil.phi", "soil.n", "soil.k_1", "soil.theta_1", "motor.gear", "motor.resistance",
           "effect.MotionResistance.R", "gravity", "start.x")  # fmt: skip


def drawn(seed):
    """A usual drive with a number of it: name, settings, the number's name."""
    rng = np.random.default_rng([30, seed])
    name = str(rng.choice(list(GROUNDS)))
    control = str(rng.choice(["none", "true", "eq9", "limit"]))
    settings = {
        "duration": 4.0,
        "control": control,
        "soil.k": float(10 ** rng.uniform(-2.5, -1.5)),
        "soil.phi": float(rng.uniform(0.4, 0.7)),
        "start.x": float(rng.uniform(-0.2, -0.01)),
    }
    gains = ()
    if control in ("true", "eq9"):
        settings["control.S_d"], gains = float(rng.uniform(0.05, 0.3)), ("control.k_p", "control.k_i", "control.S_d")
    defaults = {setting.name: setting.value for setting in settings_of(name, **settings)}
    return (
        name,
        settings,
        str(rng.choice([number for number in (*NUMBERS, *GROUNDS[name], *gains) if defaults.get(number)])),
    )


def shares(trace, slope, off):
    """The greatest of what a slope is off, by unit: over the greatest slope, or a hundredth of the greatest value."""
    errors_found = {}
    for unit in {trace.unit(channel) for channel in slope.channels}:
        channels = [channel for channel in slope.channels if trace.unit(channel) == unit]
        difference, size, distant = (
            max(float(np.nanmax(np.abs(rows[channel]))) for channel in channels)
            for rows in (slope.channels, trace, off)
        )
        if difference:
            errors_found[unit] = distant / max(difference, 1e-2 * size / abs(slope.value))
    return errors_found


def reference(name, settings, number, value, course, width):
    """Return the difference of the eighth order of every channel."""
    around = {
        i: drive_along(scenario(name, **{**settings, number: value + i * width}), course)
        for i in (*EIGHTH, *(-i for i in EIGHTH))
    }
    return {
        channel: sum(weight * (around[i][channel] - around[-i][channel]) for i, weight in EIGHTH.items()) / width
        for channel in set(around[1]) - {"t_s"}
    }


def judged(seed):
    """Return for a drawn drive the greatest share that its tangent is off from differences of the eighth order, and the
    share by which differences of two widths disagree with each other.
    """
    name, settings, number = drawn(seed)
    trace, slopes = sensitivities(name, [number], **settings)
    slope, course = slopes[number], course_of(scenario(name, **settings), trace)
    assert slope.tangent
    h = WIDTH * abs(slope.value)
    near, wide = (reference(name, settings, number, slope.value, course, width) for width in (h, 3.0 * h))
    apart = shares(trace, slope, {channel: near[channel] - wide[channel] for channel in near})
    # Where the differences disagree, the nearer one counts.
    off = min(
        max(shares(trace, slope, {name: slope[name] - row for name, row in rows.items()}).values(), default=0.0)
        for rows in (near, wide)
    )
    return off, max(apart.values(), default=0.0)


def agree(seeds, share=0.9):
    """Assert that tangents equal differences wherever differences are sure of themselves."""
    off, unsure = np.array([judged(seed) for seed in seeds]).T
    for seed, *two in zip(seeds, off, unsure, strict=True):
        print(seed, *two, *drawn(seed))
    print(
        f"off: median {np.median(off):.1e}, where sure {off[unsure < NEAR].max():.1e}; sure: {np.mean(unsure < NEAR)}"
    )
    assert np.mean(off > 0.0) > 0.7, "numbers without an effect test nothing"
    smooth = [drawn(seed)[0] != "hills" for seed in seeds]  # on hills the wheels meet edges of cells all the time
    assert np.mean(unsure[smooth] < NEAR) >= share
    assert (off <= np.maximum(NEAR, unsure)).all()


@pytest.mark.slow
def test_slopes_of_ten_drawn_drives():
    """Eight of nine are sure to NEAR; of a hundred, nine of ten."""
    agree(range(10), 0.85)


@pytest.mark.nightly
def test_slopes_of_a_hundred_drawn_drives():
    agree(range(10, 110))


def test_on_level_ground_a_start_moves_the_whole_drive():
    """x follows start.x and nothing else does; y and heading turn with start.yaw, across the cut of the angle too."""
    _, slopes = sensitivities("flat", ["start.x", "start.yaw"], duration=2.0, **{"start.yaw_deg": 180.0})
    x, yaw = slopes["start.x"], slopes["start.yaw"]
    assert (x.value, x.unit, yaw.value, yaw.unit) == (0.0, "m", math.pi, "rad")
    assert x["body_x"] == pytest.approx(1.0, abs=1e-8)
    for channel in ("body_y", "body_z", "body_vx", "slip_ml", "sinkage_fr"):
        assert np.abs(x[channel]).max() < 1e-8, channel
    trace = scenario("flat", duration=2.0).drive()
    assert yaw["body_yaw"] == pytest.approx(1.0, abs=1e-7)
    assert yaw["body_y"] == pytest.approx(-trace["body_x"], abs=1e-7)
    assert np.abs(yaw["body_x"]).max() < 1e-7


@pytest.mark.parametrize("tolerance", [1e-4, 3e-7])
def test_a_drive_along_its_own_steps_is_the_same_to_the_bit(tolerance):
    case = scenario("step", form="net", duration=4.0)
    case = dataclasses.replace(case, timing=dataclasses.replace(case.timing, tolerance=tolerance))
    trace = case.drive()
    course = course_of(case, trace)
    again = drive_along(case, course)
    assert len(set(course.lengths)) > 1, "steps that never change test nothing"
    assert (course.dt < 0.5 * case.timing.dt) == (tolerance == 3e-7)
    assert all(np.array_equal(again[channel], trace[channel]) for channel in trace)


class Slowed:
    """Half duty, and after a second by as much less as the rover is ahead of a place, as `bend` of that has it."""

    def __init__(self, place, bend):
        self.place, self.bend = place, bend
        self.reset()

    def reset(self):
        self.less = 0.0

    def __call__(self, reading):
        if math.isclose(reading.t, 1.0):
            self.less = self.bend(100.0 * (reading.truth.position[0] - self.place))
        return 0.5 - self.less


def test_a_bend_is_in_the_error_of_its_slope():
    """A controller that begins to act just here: beside it those that act on both sides, or on none."""
    place = float(scenario("flat", control=lambda reading: 0.5, duration=1.0).drive()["body_x"][-1])

    def slope(bend):
        return sensitivities("flat", ["motor.supply"], duration=2.0, control=Slowed(place, bend))[1]["motor.supply"]

    bent, acting, idle = (slope(bend)["body_x"][-1] for bend in (lambda x: max(x, 0.0), lambda x: x, lambda x: 0.0))
    assert abs(acting - idle) > 0.1 * abs(idle)
    assert bent == pytest.approx(0.5 * (acting + idle), rel=1e-4)
    assert slope(lambda x: max(x, 0.0)).errors["body_x"][-1] == pytest.approx(0.5 * abs(acting - idle), rel=1e-3)


def test_rows_that_a_drive_beside_does_not_reach_are_no_numbers():
    """A wheel that is buried in another row where the ground is a little softer."""
    settings = {"add": "DiggingMemory.c_d=0.1", "terrain.angle_deg": 7.0, "soil": "table-1", "duration": 30.0}
    trace, slopes = sensitivities("incline", ["soil.k"], {"soil.k": 1e-3}, **settings)
    assert trace.attrs["stop"].startswith("buried")
    missing = np.isnan(slopes["soil.k"]["body_x"])
    assert 0 < missing.sum() < 0.5 * len(missing)
    assert not missing[: -missing.sum()].any()


EVENTS = {
    "the rover meets edges and stops in the ditch": ("ditch", {"duration": 12.0, "soil": "table-1"}, "soil.phi"),
    "duties reach and leave their limit": (
        "incline",
        {"duration": 4.0, "control": "true", "control.S_d": 0.05},
        "control.k_i",
    ),
    "a torque limit": ("bump", {"duration": 4.0, "control": "limit"}, "soil.k"),
    "a wheel is buried": (
        "incline",
        {"add": "DiggingMemory.c_d=0.1", "terrain.angle_deg": 7.0, "soil": "table-1", "duration": 30.0},
        "soil.n",
    ),
    "a mass, which the rigid body carries": ("step", {"add": "PointMass.m=0.4", "duration": 4.0}, "effect.PointMass.m"),
    "springs of the body store energy": ("bump", {"add": "DifferentialCompliance", "duration": 4.0}, "soil.k"),
}
"""Event that a drive has -> name, settings and number."""


@pytest.mark.parametrize("event", EVENTS)
def test_tangents_across_the_events_of_a_drive(event):
    name, settings, number = EVENTS[event]
    trace, slopes = sensitivities(name, [number], **settings)
    slope, course = slopes[number], course_of(scenario(name, **settings), trace)
    assert slope.tangent
    assert not any(error.any() for error in slope.errors.values())
    # Narrow differences have the round-off of the state at rest, wide ones reach the next event.
    off = []
    for width in (6.0 * WIDTH, 2.0 * WIDTH):
        near = reference(name, settings, number, slope.value, course, width * abs(slope.value))
        off.append(max(shares(trace, slope, {name: slope[name] - near[name] for name in slope.channels}).values()))
    assert min(off) < NEAR, off
    assert np.abs(slope["body_x"]).max() > 0.0


def test_twelve_numbers_together_have_the_tangents_that_they_have_alone():
    """More numbers than a dual number holds: two drives."""
    numbers = [*NUMBERS, "terrain.wall_angle", "control.delta"]
    _, together = sensitivities("ditch", numbers, duration=3.0)
    _, alone = sensitivities("ditch", ["control.delta"], duration=3.0)
    assert len(together) == 12
    assert all(slope.tangent for slope in together.values())
    for channel, values in alone["control.delta"].channels.items():
        np.testing.assert_allclose(together["control.delta"][channel], values, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("settings", "widths"),
    [({"control": "onboard"}, {}), ({"control": lambda reading: 0.5}, {}), ({}, {"soil.phi": 1e-4})],
    ids=["on-board estimate", "controller in Python", "a width"],
)
def test_where_there_is_no_tangent_the_slope_is_a_difference(settings, widths):
    _, slopes = sensitivities("incline", ["soil.phi"], widths=widths, duration=2.0, **settings)
    assert not slopes["soil.phi"].tangent
    assert slopes["soil.phi"].errors["body_x"].max() > 0.0
    # Both are the derivative of the same drive where the controller does not depend on the drive.
    if settings.get("control") != "onboard":
        _, tangents = sensitivities("incline", ["soil.phi"], duration=2.0, control="none", **{"control.delta": 0.5})
        same = tangents if settings else sensitivities("incline", ["soil.phi"], duration=2.0)[1]
        assert slopes["soil.phi"]["body_x"] == pytest.approx(same["soil.phi"]["body_x"], rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("number", ["soil.q", "terrain.wall_angle_deg", "control", "duration", "dt"])
def test_what_is_no_number_of_the_drive_is_refused(number):
    with pytest.raises(ParameterError, match=f"'{number}'"):
        sensitivities("ditch", [number])


def test_one_name_alone_is_no_list():
    with pytest.raises(ParameterError, match=r"\['soil.k'\]"):
        sensitivities("flat", "soil.k")


@pytest.mark.parametrize("widths", [{"soil.phj": 1e-4}, {"soil.phi": 0.0}, {"soil.phi": math.nan}])
def test_a_width_of_another_number_or_none_is_refused(widths):
    (name,) = widths
    with pytest.raises(ParameterError, match=f"'{name}'"):
        sensitivities("flat", ["soil.phi"], widths=widths, duration=1.0)


def test_a_number_at_its_bound_is_refused_by_its_name():
    with pytest.raises(ParameterError, match=r"soil\.c"):
        sensitivities("flat", ["soil.c"], duration=1.0, **{"soil.c": 0.0})
