"""Names beside points cover neither each other nor a point, and stay within the drawing."""

import itertools

import pytest
from matplotlib.figure import Figure

from rover_pin.rover.proposal.new_rover import new_rover
from rover_pin.rover.proposal.picture import Name, picture, place_names
from rover_pin.rover.rover import load_rover
from tests.rover import farm as made


def boxes(axes):
    """Name -> x from, y from, x to, y to in pixels."""
    return {text.get_text(): text.get_window_extent().extents for text in axes.texts if text.get_text()}


def apart(box, next_box):
    return box[2] <= next_box[0] or next_box[2] <= box[0] or box[3] <= next_box[1] or next_box[3] <= box[1]


def assert_readable(axes, points):
    """Points are in the axes' units, by name."""
    label_boxes = boxes(axes)
    assert label_boxes.keys() == points.keys()
    for (name, label_box), (next_name, next_box) in itertools.combinations(label_boxes.items(), 2):
        assert apart(label_box, next_box), f"{name} is over {next_name}"
    frame = axes.bbox.extents
    for name, box in label_boxes.items():
        assert (box[:2] > frame[:2]).all(), name
        assert (box[2:] < frame[2:]).all(), name
        for x, y in axes.transData.transform(list(points.values())):
            assert apart(box, (x, y, x, y)), f"{name} covers a point"


def drawn(points):
    figure = Figure(figsize=(5.0, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    place_names([axes], [[Name(name, at, "black") for name, at in points.items()]])
    figure.draw_without_rendering()
    return axes


@pytest.mark.parametrize("at", [(0.5, 0.5), (0.01, 0.99), (0.99, 0.02)])
def test_names_of_points_at_one_place_stand_apart_and_lead_to_it(at):
    points = {f"joint number {i}": at for i in range(9)}
    axes = drawn(points)
    assert_readable(axes, points)
    lines = [line.get_xydata() for line in axes.lines]
    assert 0 < len(lines) < 9
    place, ends = axes.transData.transform(at), [axes.transData.transform(line) for line in lines]
    for start, end in ends:
        assert start == pytest.approx(place)
        touched = [
            box for box in boxes(axes).values() if (end >= box[:2] - 1e-6).all() and (end <= box[2:] + 1e-6).all()
        ]
        assert len(touched) == 1


def small(folder):
    """Six wheels, four of them steered, 0.13 m long, with the names that exporters give."""
    farm = made.Farm(mass=2.0, centre="0.005 0 0.02")
    for y, side in ((0.04, "left"), (-0.04, "right")):
        rocker, bogie = f"{side}_rocker_joint", f"{side}_bogie_joint"
        farm.link(rocker, "body", "revolute", f"0 {y} 0.03", mass=0.2, size=0.05)
        farm.link(bogie, f"{rocker}_link", "revolute", "-0.03 0 -0.015", mass=0.1, size=0.03)
        for end, parent, at in (("front", rocker, "0.05 0 -0.01"), ("rear", bogie, "-0.025 0 0.005")):
            steer = f"{end}_{side}_steering_joint"
            farm.link(steer, f"{parent}_link", "revolute", at, "0 0 1", mass=0.05, size=0.02)
            farm.wheel(f"{end}_{side}_wheel_joint", f"{steer}_link", "0 0 -0.02", r=0.012, b=0.01)
        farm.wheel(f"middle_{side}_wheel_joint", f"{bogie}_link", "0.025 0 -0.015", r=0.012, b=0.01)
    (folder / "small.urdf").write_text(farm.urdf.replace('="0.05"', '="0.002"'))
    return new_rover(folder / "small.urdf").files[0]


@pytest.mark.parametrize("rover", ["cart", "nexus6", "nexus6_links", small])
def test_the_picture_of_a_proposed_rover_can_be_read(rover, tmp_path):
    loaded = load_rover(rover if isinstance(rover, str) else rover(tmp_path))
    figure = picture(loaded)
    figure.draw_without_rendering()
    side, plan = figure.axes
    joints = set(loaded.model.names[2:])
    for axes in (side, plan):
        label_boxes = boxes(axes)
        assert label_boxes.keys() - joints == {"centre of mass"}
        for (name, label_box), (next_name, next_box) in itertools.combinations(label_boxes.items(), 2):
            assert apart(label_box, next_box), f"{name} is over {next_name}"
        for name, box in label_boxes.items():
            assert (box[:2] > axes.bbox.extents[:2]).all(), name
            assert (box[2:] < axes.bbox.extents[2:]).all(), name
    assert boxes(plan).keys() >= joints
