"""A drive at a few instants: from the side, and from above where it turns."""

import math
import re
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.plot.sheet import MARGINS, in_lines, sheet
from rover_pin.plot.side import Pose, draw_above, draw_ground, draw_rover, poses
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.poses import Turned, of_side, on_the_ground
from rover_pin.simulation.trace.trace import Trace
from rover_pin.view.colours import draw_heights

FURTHEST_APART = 0.5
"""Way [m] between two snapshots of a rover, about."""
WIDTH, BAR = 10.0, 0.8
"""Of the figure, and of what stands at its right where heights have colours [in]."""
PAPER = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.0}
A_LABEL = (0.6, 0.2)
"""Width and height [in] that a label takes, at most about."""
SAME_PLACE = 0.02
"""Share of the width within which two snapshots have one label."""


def snapshots(trace: Trace, model: Model, count: int = 6) -> Figure:
    """Return the rover at evenly spaced instants, more than `count` on a long way; later ones are darker.

    From the side one sees the wheels of the side whose ground is the less even, and that ground; the other side's is
    dashed. A drive that turns is shown from above, too; only so where the wheels leave the ground that would be drawn.
    """
    trace = on_the_ground(trace, model.rover, model.terrain)
    x, y = (trace.get(f"body_{name}", np.zeros(trace.t.size)) for name in "xy")
    way = float(np.nansum(np.hypot(np.diff(x), np.diff(y))))
    rows = np.linspace(0, trace.t.size - 1, max(count, round((0.6 + way) / FURTHEST_APART))).astype(int)
    instants = poses(trace, model.rover, rows)
    turned, side = Turned.of(trace), _Side(instants, model)
    views: list[_Side | _Above] = [side] if turned.side_tells and side.stands else []
    if not views or turned.from_above:
        views.append(_Above(instants, model, trace))
    heights = [view.height for view in views]
    figure, axes = sheet(
        len(views), (WIDTH, sum(heights) + 1.0 + 0.5 * (len(views) - 1)), squeeze=False, height_ratios=heights
    )
    right = BAR if isinstance(views[-1], _Above) else MARGINS[1]
    figure.subplots_adjust(hspace=0.25, right=1.0 - right / WIDTH)
    for view, panel in zip(views, axes[:, 0], strict=True):
        view.draw(panel)
    axes[0, 0].set_title(in_lines(title_of(trace)), fontsize=8)
    return figure


class _View:
    """What a view shows: a range of its two coordinates, and how high that makes it [in]."""

    def __init__(self, low: tuple[float, float], high: tuple[float, float]):
        self.low, self.high = low, high
        inner = WIDTH - MARGINS[0] - MARGINS[1]
        self.height = min(max(inner * (high[1] - low[1]) / (high[0] - low[0]), 1.0), 5.5)

    def frame(self, axes: Axes, names: tuple[str, str]) -> None:
        """Set limits, labels and equal scales."""
        limits = {"xlim": (self.low[0], self.high[0]), "ylim": (self.low[1], self.high[1])}
        axes.set(aspect="equal", xlabel=f"{names[0]} [m]", ylabel=f"{names[1]} [m]", **limits)


class _Side(_View):
    def __init__(self, instants: list[Pose], model: Model):
        self.instants, self.model = instants, model
        centres, r = np.array([pose.centres for pose in instants]), _radius(model.rover)
        self.span = float(centres[..., 0].min()) - 3 * r, float(centres[..., 0].max()) + 3 * r
        self.y = {side: float(np.mean(centres[:, of_side(model.rover, side), 1])) for side in "lr"}
        ground = {side: model.terrain.height(np.linspace(*self.span, 500), y) for side, y in self.y.items()}
        self.side = max("lr", key=lambda side: (float(np.ptp(ground[side])), side == "l"))
        tops = [float(pose.q[2]) for pose in instants] + [float(centres[..., 2].max()) + r]
        self.top = max(tops) + 0.3 * r
        lowest = min(float(profile.min()) for profile in ground.values())
        self.stands = self._stands(centres[:, of_side(model.rover, self.side)], 0.25 * r)
        super().__init__((self.span[0], lowest - 0.05), (self.span[1], self.top + 2.2 * r + 0.05))

    def _stands(self, centres: np.ndarray, within: float) -> bool:
        """Return whether the ground at one y is, within this height, that under the wheels wherever they went."""
        under = self.model.terrain.height(centres[..., 0], centres[..., 1])
        drawn = self.model.terrain.height(centres[..., 0], np.full(centres.shape[:-1], self.y[self.side]))
        return bool(np.max(np.abs(under - drawn)) < within)

    def draw(self, axes: Axes) -> None:
        """Draw ground, rovers, and when each was."""
        rover, far_side = self.model.rover, "r" if self.side == "l" else "l"
        draw_ground(axes, self.model.terrain, self.span, self.y[self.side], self.y[far_side])
        for shade, pose in zip(np.linspace(0.65, 0.0, len(self.instants)), self.instants, strict=True):
            draw_rover(axes, rover, pose.q, str(shade), self.side)
        for x, when, line in _labels(self.instants, self.span):
            axes.text(x, self.top + 0.9 * _radius(rover) * line, when, ha="center", va="bottom", fontsize=8)
        self.frame(axes, ("x", "z"))
        side_name = "left" if self.side == "l" else "right"
        axes.text(0.995, 0.03, f"{side_name} wheels", transform=axes.transAxes, ha="right", fontsize=8, color="#555555")


class _Above(_View):
    def __init__(self, instants: list[Pose], model: Model, trace: Trace):
        self.instants, self.model, self.trace = instants, model, trace
        centres, r = np.array([pose.centres for pose in instants]), _radius(model.rover)
        low, high = centres.min(axis=(0, 1))[:2] - 3 * r, centres.max(axis=(0, 1))[:2] + 3 * r
        super().__init__((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))

    def draw(self, axes: Axes) -> None:
        """Draw the ground by its height, the body's way, rovers, and when each was."""
        draw_heights(axes, self.model.terrain, (self.low[0], self.high[0], self.low[1], self.high[1]))
        axes.plot(self.trace["body_x"], self.trace["body_y"], color="#0072b2", lw=1)
        for shade, pose in zip(np.linspace(0.65, 0.0, len(self.instants)), self.instants, strict=True):
            draw_above(axes, self.model.rover, pose, str(shade))
        for (x, y), when in self._times():
            axes.text(x, y, when, ha="center", va="center", fontsize=8, bbox=PAPER)
        self.frame(axes, ("x", "y"))

    def _times(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield place and text of the labels: within a pose, ahead of it where poses overlap, one for those alike."""
        inch = max((self.high[0] - self.low[0]) / WIDTH, (self.high[1] - self.low[1]) / self.height)
        spacing = inch * np.array(A_LABEL)
        middles = np.array([pose.centres[:, :2].mean(axis=0) for pose in self.instants])
        overlaps = (np.abs(middles[:, None] - middles) < spacing).all(axis=-1)
        places = [
            _ahead(pose, _radius(self.model.rover)) if close.sum() > 1 else middle
            for pose, close, middle in zip(self.instants, overlaps, middles, strict=True)
        ]
        groups: list[list[int]] = []
        for at, place in enumerate(places):
            close_groups = [group for group in groups if (np.abs(places[group[-1]] - place) < spacing).all()]
            if close_groups:
                close_groups[0].append(at)
            else:
                groups.append([at])
        for group in groups:
            times = [f"{self.instants[at].t:.1f}" for at in group]
            together = f"{times[0]} to {times[-1]}" if group == [*range(group[0], group[-1] + 1)] else ", ".join(times)
            within = np.clip(places[group[-1]], np.array(self.low) + spacing, np.array(self.high) - spacing)
            yield within, f"{together if len(group) > 1 else times[0]} s"


def _ahead(pose: Pose, r: float) -> np.ndarray:
    """Return the place beyond the foremost wheels, on the middle line."""
    left = pose.left / max(float(np.linalg.norm(pose.left)), 1e-9)
    ahead, middle = np.array([left[1], -left[0]]), pose.centres[:, :2].mean(axis=0)
    return middle + ahead * (float(((pose.centres[:, :2] - middle) @ ahead).max()) + 1.6 * r)


def _radius(rover: Rover) -> float:
    return max(float(wheel.wheel.r) for wheel in rover.wheels)


def _labels(instants: list[Pose], span: tuple[float, float]) -> Iterator[tuple[float, str, int]]:
    """Yield place, text and line (0 or 1) of the labels: one for all poses at one place, the next one line higher."""
    wide = span[1] - span[0]
    groups: list[list[Pose]] = []
    for pose in instants:
        if groups and abs(pose.q[0] - groups[-1][-1].q[0]) < SAME_PLACE * wide:
            groups[-1].append(pose)
        else:
            groups.append([pose])
    last, line = -math.inf, 0
    for group in sorted(groups, key=lambda members: float(members[0].q[0])):
        x, ends = float(np.mean([pose.q[0] for pose in group])), f"{group[-1].t:.1f} s"
        line = 1 - line if abs(x - last) < 0.07 * wide else 0
        last = x
        yield x, ends if len(group) == 1 else f"{group[0].t:.1f} to {ends}", line


def title_of(trace: Trace) -> list[str]:
    """Return what a figure says of its drive, part by part."""
    attrs = trace.attrs
    words = [
        str(attrs.get("scenario", "drive")),
        str(attrs.get("outcome") or f"stop: {attrs.get('stop', '-')}"),
        f"control: {re.sub(r'(?<=[a-z])(?=[A-Z])', ' ', str(attrs.get('control', '-'))).lower()}",
        f"g = {float(attrs.get('gravity_mps2', float('nan'))):.2f} m/s²",
    ]
    return [*words, *_deepest(trace)]


def _deepest(trace: Trace) -> Iterator[str]:
    depths = {wheel: trace[f"sinkage_{wheel}"] for wheel in trace.wheels if f"sinkage_{wheel}" in trace}
    most = {wheel: float(np.nanmax(depth)) for wheel, depth in depths.items() if np.any(np.isfinite(depth))}
    if most:
        wheel = max(most, key=lambda name: most[name])
        yield f"deepest sinkage {1e3 * most[wheel]:.1f} mm ({wheel})"
