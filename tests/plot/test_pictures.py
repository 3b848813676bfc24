"""Figures of drives with several rovers and terrains: they show the drive, and the title states constant channels in
words.
"""

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.patches import Polygon

from rover_pin import Trace, scenario
from rover_pin.base.errors import MissingExtraError, ParameterError
from rover_pin.plot import history, snapshots


def driven(name, **settings):
    case = scenario(name, **settings)
    return case.model, case.drive()


@pytest.fixture(scope="module")
def ditch():
    return driven("ditch", duration=8.0)


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in (*axes.texts, axes.title)]


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


def test_a_drive_across_hills_is_seen_from_above_alone():
    """In a side view, the wheels would float above the ground of another y, or would be inside it."""
    model, trace = driven("hills", rover="cart", soil="table-1", duration=8.0, **{"terrain.height": 0.15})
    assert [axes.get_ylabel() for axes in snapshots(trace, model).axes] == ["y [m]"]


@pytest.mark.parametrize("name", ["turn", "ditch"])
def test_no_legend_hides_a_line_and_none_is_cut(name):
    figure = history(driven(name, duration=3.0)[1])
    figure.draw_without_rendering()
    for axes in figure.axes:
        box = axes.get_legend().get_window_extent()
        assert box.x0 >= axes.get_window_extent().x1
        assert box.x1 <= figure.bbox.x1
        assert box.height <= axes.get_window_extent().height


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"), [("one-sided-bump", {}), ("park", {}), ("field", {}), ("point-turn", {"rover": "cart"})]
)
def test_a_title_is_read_whole(name, settings):
    """The longest titles fit: a drive with a turn and constant channels, and a rover that nearly stalls."""
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
    with pytest.raises(MissingExtraError, match=r"xarray.*install"):
        trace.to_xarray()
    fake_module = types.SimpleNamespace(Dataset=lambda data, coords, attrs: (data, coords, attrs))
    monkeypatch.setitem(sys.modules, "xarray", fake_module)
    data, coords, _ = trace.to_xarray()
    assert data["body_x"][2] == {"units": "m"}
    assert list(coords) == ["t_s"]
