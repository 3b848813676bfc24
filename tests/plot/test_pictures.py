"""Pictures of any rover on any ground: what is in them is what was driven, and what stands still is said in words."""

import dataclasses

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.patches import Circle, Polygon

from rover_pin.base.errors import MissingExtraError, ParameterError
from rover_pin.plot import history, snapshots
from rover_pin.plot.side import poses
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.trace.poses import footprint
from rover_pin.simulation.trace.trace import Trace
from rover_pin.view.film import Film


def driven(name, **settings):
    made = scenario(name, **settings)
    return made.model, made.drive()


@pytest.fixture(scope="module")
def ditch():
    return driven("ditch", duration=8.0)


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in (*axes.texts, axes.title)]


def test_every_pose_has_its_time_and_the_depth_is_said(ditch):
    model, trace = ditch
    said = texts(snapshots(trace, model))
    times = {float(word.removesuffix(" s").split(" to ")[-1]) for word in said if word.endswith(" s")}
    assert max(times) == pytest.approx(trace.t[-1], abs=0.06)
    deepest = max(float(np.max(trace[f"sinkage_{wheel}"])) for wheel in trace.wheels)
    assert any(f"deepest sinkage {1e3 * deepest:.1f} mm" in word for word in said)


def test_all_wheels_that_are_drawn_are_within_the_picture(ditch):
    model, trace = ditch
    (axes,) = snapshots(trace, model).axes
    (low, high), (floor, top) = axes.get_xlim(), axes.get_ylim()
    rims = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert len(rims) >= 3 * 6
    for rim in rims:
        assert low < rim.center[0] - rim.radius
        assert rim.center[0] + rim.radius < high
        assert floor < rim.center[1] - rim.radius
        assert rim.center[1] + rim.radius < top


def test_drawn_ground_has_the_rock_that_is_driven_over():
    model, trace = driven("rocks", duration=7.0)
    (axes,) = snapshots(trace, model).axes
    heights = axes.lines[0].get_ydata()
    assert np.ptp(heights) > 0.02
    assert "right wheels" in texts(axes.figure)


def test_a_turn_is_seen_from_above():
    model, trace = driven("turn", duration=12.0)
    figure = snapshots(trace, model)
    names = [axes.get_ylabel() for axes in figure.axes]
    assert names == ["z [m]", "y [m]"]
    assert len([patch for patch in figure.axes[1].patches if isinstance(patch, Polygon)]) >= 6 * 7


def test_turn_on_the_spot_labels_every_pose_time_without_overlap():
    model, trace = driven("point-turn")
    (axes,) = snapshots(trace, model).axes
    assert [text.get_text() for text in axes.texts] == ["0.1 s", "4.0 s", "8.0 s", "12.0 s", "16.0 s", "20.0 s"]
    axes.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(one.overlaps(other) for at, one in enumerate(boxes) for other in boxes[:at])
    frame = axes.get_window_extent()
    assert all(frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1 for box in boxes)


def test_poses_that_are_alike_share_a_label_from_above():
    model, trace = driven("turn", duration=4.0)
    still = {name: np.repeat(values[:1], len(values)) for name, values in trace.channels.items() if name != "t_s"}
    turned = {**still, "t_s": trace.t, "body_yaw": np.linspace(0.0, 1e-3, len(trace.t))}
    (text,) = snapshots(dataclasses.replace(trace, channels=turned), model).axes[-1].texts[:1]
    assert text.get_text().endswith(f" to {trace.t[-1]:.1f} s")


def test_a_drive_across_hills_is_seen_from_above_alone():
    """From the side its wheels would hover over, or stand in, the ground of another y."""
    model, trace = driven("hills", rover="cart", soil="table-1", duration=8.0, **{"terrain.height": 0.15})
    assert [axes.get_ylabel() for axes in snapshots(trace, model).axes] == ["y [m]"]


def test_lines_that_are_one_to_the_eye_are_one(ditch):
    _, trace = ditch
    axes = history(trace).axes[0]
    assert [line.get_label() for line in axes.lines] == ["fl = fr", "ml = mr", "rl = rr"]
    changed = {**trace.channels, "slip_fr": trace["slip_fr"] + 0.1}
    other = dataclasses.replace(trace, channels=changed)
    assert "fl" in [line.get_label() for line in history(other).axes[0].lines]


def test_what_stands_still_is_said_and_not_drawn(ditch):
    _, trace = ditch
    figure = history(trace)
    assert "duty [-]" not in [axes.get_ylabel() for axes in figure.axes]
    assert "duty 0.55" in figure.axes[0].get_title()
    assert "control: constant duty" in figure.axes[0].get_title()


def test_channel_constant_but_differing_by_wheel_is_given_each():
    trace = driven("point-turn", duration=2.0)[1]
    figure = history(trace)
    assert [axes.get_ylabel() for axes in figure.axes if "duty" in axes.get_ylabel()] == []
    title = figure.axes[0].get_title().replace("\n", " ")
    assert "duty -0.55 (fl, rl), 0.55 (fr, rr), -0.401 (ml), 0.401 (mr)" in title
    changed = {**trace.channels, "duty_ml": np.linspace(0.0, 0.1, trace.t.size)}
    assert "duty [-]" in [axes.get_ylabel() for axes in history(dataclasses.replace(trace, channels=changed)).axes]
    flat = {
        name: np.full(trace.t.size, 2e-3) if name.startswith("sinkage") else values for name, values in changed.items()
    }
    assert "sinkage 2 mm" in history(dataclasses.replace(trace, channels=flat)).axes[0].get_title()


@pytest.mark.parametrize("name", ["turn", "ditch"])
def test_no_legend_hides_a_line_and_none_is_cut(name):
    figure = history(driven(name, duration=3.0)[1])
    figure.draw_without_rendering()
    for axes in figure.axes:
        box = axes.get_legend().get_window_extent()
        assert box.x0 >= axes.get_window_extent().x1
        assert box.x1 <= figure.bbox.x1
        assert box.height <= axes.get_window_extent().height


def test_wheels_are_seen_from_above_as_they_are_steered():
    """About a turn's centre, every wheel's axle points at it: of the rover that drives, and in the moving picture."""
    model, trace = driven("turn", duration=2.0)
    pose = poses(trace, model.rover, [trace.t.size - 1])[0]
    film = Film.of(trace, model.rover, model.terrain)
    assert film.left[-1] == pytest.approx(pose.axles)
    yaw = trace["body_yaw"][-1]
    centre = pose.q[:2] + 1.0 * np.array([-np.sin(yaw), np.cos(yaw)])  # of the scenario's 1 m radius
    for wheel, at, axle in zip(model.rover.wheels, pose.centres, pose.axles, strict=True):
        towards = (centre - at[:2]) / np.linalg.norm(centre - at[:2])
        assert float(towards @ axle[:2]) == pytest.approx(1.0, abs=2e-3), wheel.name
        ends = footprint(wheel, at, axle)
        assert ends.mean(axis=0) == pytest.approx(at[:2])
        assert float(np.linalg.norm(ends[0] - ends[1])) == pytest.approx(float(wheel.wheel.b))
        assert abs(float((ends[0] - ends[3]) @ towards)) < 0.05 * float(wheel.wheel.r)
    assert abs(np.degrees(trace["steer_fl"][-1])) > 5.0


@pytest.mark.parametrize(
    ("name", "settings"), [("one-sided-bump", {}), ("park", {}), ("field", {}), ("point-turn", {"rover": "cart"})]
)
def test_a_title_is_read_whole(name, settings):
    """The longest: turned, with what is constant; and a rover that all but stalls."""
    model, trace = driven(name, duration=12.0, **settings)
    for figure in (snapshots(trace, model), history(trace)):
        figure.draw_without_rendering()
        box = figure.axes[0].title.get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1


def test_a_trace_draws_itself_on_axes_that_are_given(ditch):
    _, trace = ditch
    axes = history(trace).axes[-1]
    assert trace.plot("body_x", "body_z", ax=axes) is axes
    assert axes.get_ylabel() == "body_x, body_z [m]"
    alone = trace.plot()
    assert len(alone.lines) == 3
    assert alone.figure.number in pyplot.get_fignums()  # which notebooks and `pyplot.show()` show
    assert trace.plot("slip", "body_pitch").get_ylabel() == "slip, body_pitch [- or rad]"
    with pytest.raises(ParameterError, match="'body_x'"):
        trace.plot("body_xx")


def test_a_trace_shows_itself_in_a_notebook():
    html = Trace({"t_s": [0.0, 1.0], "body_x": [0.0, 0.5], "body_y": [0.0, 0.0]}, attrs={"stop": "<b>"})._repr_html_()
    assert "2 rows of 3 channels" in html
    assert "<td>0.5</td>" in html
    assert "&lt;b&gt;" in html


def test_xarray_is_requested_if_missing_and_used_if_present(monkeypatch):
    import sys
    import types

    trace = Trace({"t_s": [0.0, 1.0], "body_x": [0.0, 0.5]})
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingExtraError, match=r"xarray:.*install"):
        trace.to_xarray()
    made = types.SimpleNamespace(Dataset=lambda data, coords, attrs: (data, coords, attrs))
    monkeypatch.setitem(sys.modules, "xarray", made)
    data, coords, _ = trace.to_xarray()
    assert data["body_x"][2] == {"units": "m"}
    assert list(coords) == ["t_s"]
