"""The frames of a drive: links have the poses of the kinematics, wheels turn, and forces carry the rover's weight."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.patches import Circle

from rover_pin import Trace, load_rover, scenario
from rover_pin.base.errors import DataError
from rover_pin.simulation.trace.poses import PathExtent, on_the_ground
from rover_pin.view.animation import _figure, _slip, write_animation
from rover_pin.view.colours import slip_colour
from rover_pin.view.film import Film
from rover_pin.view.triangles import shapes_of


@pytest.fixture(scope="module", params=["nexus6", "cart", "nexus6_links"])
def driven(request):
    case = scenario("cross-slope", rover=request.param, duration=1.5)
    return case, case.drive()


def film_of(driven):
    hypothesis, trace = driven
    return Film.of(trace, hypothesis.model.rover, hypothesis.model.terrain)


def test_wheels_lie_below_the_ground_by_their_sinkage(driven):
    hypothesis, trace = driven
    film, wheels = film_of(driven), hypothesis.model.rover.wheels
    up = hypothesis.model.terrain.normal(0.0, 0.0)
    for n, wheel in enumerate(wheels):
        over = film.centres[-1, n, 2] - hypothesis.model.terrain.height(*film.centres[-1, n, :2])
        # a wheel's lower edge on the slope: half its width times the slope is what the two may differ by
        edge = 0.5 * float(wheel.wheel.b) * 0.11
        depth = trace[f"sinkage_{wheel.name}"][film.rows[-1]]
        assert over * up[2] == pytest.approx(float(wheel.wheel.r) - depth, abs=edge + 1e-3)


def test_forces_carry_the_weight_and_push_along_the_travel(driven):
    hypothesis = driven[0]
    film = film_of(driven)
    weight = hypothesis.model.rover.mass * hypothesis.model.gravity
    assert film.forces is not None
    total = film.forces[-1].sum(axis=0)
    assert total[2] == pytest.approx(weight, rel=0.05)
    assert np.linalg.norm(film.forces[-1], axis=-1).sum() < 1.2 * weight
    assert film.left[-1][:, 1].min() > 0.9
    # held on the slope, which rises to the left, by a side force to the left
    assert total[:2] == pytest.approx([total[0], 0.0], abs=0.12 * weight)


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_a_missing_pose_is_taken_from_the_ground(name):
    """The rover is set down on a slope by the simulator, and its recorded height and attitude are then removed."""
    case = scenario("cross-slope", rover=name, duration=0.2, **{"terrain.angle": "8deg"})
    trace = case.drive()
    names = {name: trace[name] for name in ("t_s", "body_x", "body_y", "body_yaw")}
    ground = on_the_ground(Trace(names), case.model.rover, case.model.terrain)
    assert ground["body_roll"][-1] == pytest.approx(trace["body_roll"][-1], abs=0.01)
    assert ground["body_pitch"][-1] == pytest.approx(trace["body_pitch"][-1], abs=0.01)
    assert ground["body_z"][-1] == pytest.approx(
        trace["body_z"][-1], abs=0.2 * float(case.model.rover.wheel.r)
    )  # it sinks, unknown
    assert on_the_ground(trace, case.model.rover, case.model.terrain) is trace


def test_a_mesh_is_read_from_the_rovers_folder_and_nowhere_else(tmp_path, caplog):
    import trimesh

    rover = load_rover("cart")
    (tmp_path / "own" / "meshes").mkdir(parents=True)
    trimesh.creation.box(extents=(1.0, 2.0, 3.0)).export(tmp_path / "own" / "meshes" / "hull.stl")
    trimesh.creation.box(extents=(1.0, 2.0, 3.0)).export(tmp_path / "outside.stl")
    box = '<box size="0.6 0.36 0.16"/>'
    inside = rover.urdf.replace(box, '<mesh filename="package://cart/meshes/hull.stl" scale="0.1 0.1 0.1"/>', 1)
    outside = rover.urdf.replace(box, '<mesh filename="../outside.stl"/>')
    outside = re.sub("<cylinder [^>]*/>", '<mesh filename="../outside.stl"/>', outside)
    drawn = shapes_of(dataclasses.replace(rover, urdf=inside), tmp_path / "own")
    assert any(np.allclose(np.ptp(shape.vertices, axis=0), [0.1, 0.2, 0.3]) for shape in drawn)
    assert not caplog.text
    drawn = shapes_of(dataclasses.replace(rover, urdf=outside), tmp_path / "own")
    assert not any(np.allclose(np.ptp(shape.vertices, axis=0), [1.0, 2.0, 3.0]) for shape in drawn)
    assert caplog.text.count("mesh ../outside.stl") == 1 < outside.count("../outside.stl")


def test_slip_legend_stays_in_place_while_the_cursor_passes(driven):
    axes = Figure().add_subplot()
    draw, legend = _slip(axes, film_of(driven), None), axes.get_legend()
    places = []
    for frame in (0, -1):
        draw(frame)
        axes.figure.canvas.draw()
        places.append(legend.get_window_extent().bounds)
    assert legend._get_loc() != Legend.codes["best"]
    assert places[0] == pytest.approx(places[1])


def test_a_ghost_is_in_the_moving_picture_at_the_same_time(driven):
    hypothesis, trace = driven
    late = dataclasses.replace(trace, channels={**trace.channels, "body_x": trace["body_x"] - 0.1})
    film, ghost = film_of(driven), Film.of(late, hypothesis.model.rover, hypothesis.model.terrain)
    figure, draws = _figure(film, ghost)
    for draw in draws:
        draw(film.t.size - 1)
    rims = [patch for patch in figure.axes[0].patches if isinstance(patch, Circle)]
    local, second = (sorted(rim.center[0] for rim in rims if rim.get_facecolor()[3] == alpha) for alpha in (1, 0))
    assert np.array(local) - np.array(second) == pytest.approx(0.1)
    assert "outlines: the ghost" in [text.get_text() for axes in figure.axes for text in _words(axes)]
    with pytest.raises(DataError, match="compare drives"):
        write_animation(
            Path("never.gif"), film, "drive", Film.of(trace, load_rover(OTHER[film.rover.name]), ghost.terrain)
        )


def _words(axes):
    return axes.get_legend().get_texts() if axes.get_legend() else ()


OTHER = {"nexus6": "cart", "nexus6_links": "cart", "cart": "nexus6"}


@pytest.mark.parametrize(
    ("turn", "across", "side", "above"),
    [(0.0, 0.0, True, False), (0.0, 0.1, True, True), (0.3, 0.0, True, True), (1.5, 0.0, False, True)],
)
def test_a_drive_that_turns_is_seen_from_above(turn, across, side, above):
    t = np.linspace(0.0, 1.0, 30)
    trace = Trace({"t_s": t, "body_x": t, "body_y": across * t, "body_yaw": turn * t})
    turned = PathExtent.of(trace)
    assert (turned.from_the_side, turned.from_above) == (side, above)
    film = Film.of(trace, load_rover("cart"), scenario("flat").model.terrain)
    assert [axes.get_ylabel() for axes in _figure(film, None)[0].axes] == ["z [m]"] * side + ["y [m]"] * above


def test_wheel_colours_are_explained_next_to_their_slip(driven):
    axes = Figure().add_subplot()
    _slip(axes, film_of(driven), None)
    (strip,) = axes.child_axes
    low, high = axes.get_ylim()
    (image,) = strip.images
    row = 70
    assert tuple(image.get_array()[row, 0]) == pytest.approx(slip_colour(low + (row + 0.5) * (high - low) / 100))
    assert strip.get_ylim() == (low, high)
