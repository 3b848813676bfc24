"""Wheel-rig sets with one hidden effect, in plain NumPy; imports nothing of rover_pin.

The forces are midpoint sums over the contact arc, the load is balanced by bisection on the sinkage. Each effect is
written down once more from its published form, with its own parameter values.
"""

from __future__ import annotations

import numpy as np

NODES = 2000
SIZES = {
    "none": 0.0,
    "slip_sinkage": 0.6,
    "exit_angle": 0.35,
    "peak_stress": 1.0,
    "motion_resistance": 0.08,
    "post_peak": 0.4,
    "rate_dependence": 0.15,
    "load_exponent": 1.2,
    "digging": 0.05,
    "slip_squared_drag": 0.12,
    "sinkage_bump": 0.25,
}
"""Hidden effects at a clear size; the last two are on nobody's list."""


class Rig:
    """A wheel, a soil, and one effect of some size."""

    def __init__(self, effect="none", size=None, **soil):
        self.effect, self.size = effect, SIZES[effect] if size is None else size
        self.r, self.b = 0.0625, 0.06
        self.soil = {"c": 200.0, "phi": 0.5, "k": 0.008, "K": 9e4, "n": 1.1, "exit_ratio": 0.15} | soil

    def forces(self, h, S, W, rim, v):
        """Normal force, drawbar pull, torque at the sinkage h."""
        s = dict(self.soil)
        if self.effect == "slip_sinkage":
            s["n"] += self.size * max(S, 0.0)
        if self.effect == "exit_angle":
            s["exit_ratio"] = min(max(s["exit_ratio"] + self.size * S, 0.0), 1.0)
        if self.effect == "load_exponent":
            s["n"] += self.size * h / self.b
        dug = 0.0
        if self.effect == "digging":
            thrown, left = self.size * max(rim - v, 0.0), abs(v) / 0.04
            dug = thrown / (left + 2 * thrown / self.r)
            h = h - dug
        if h <= 0:
            return 0.0, 0.0, 0.0
        f_n, f_t, torque = self.arc(h, S, s)
        if self.effect == "peak_stress":
            f_n, f_t, torque = self.arc(h, S, s, peak=0.4 + 0.15 * S)
        if self.effect == "motion_resistance":
            f_t -= self.size * f_n * v / np.hypot(v, 0.005)
        if self.effect == "post_peak":
            lost = self.size * (1 - np.exp(-((S / 0.4) ** 2)))
            f_t, torque = f_t - lost * torque / self.r, (1 - lost) * torque
        if self.effect == "rate_dependence":
            more = self.size * np.log1p(abs(rim - v) / 0.01)
            f_t, torque = f_t + more * torque / self.r, (1 + more) * torque
        if self.effect == "digging":
            f_t -= f_n * dug / self.r * v / np.hypot(v, 0.005)
        if self.effect == "slip_squared_drag":
            f_t -= self.size * f_n * S * S
            torque += 0.8 * self.size * f_n * self.r * S * S
        return f_n, f_t, torque

    def arc(self, h, S, s, peak=None):
        """Midpoint sums over the arc; with `peak`, Wong and Reece's stress."""
        theta_1 = np.arccos(1 - h / self.r)
        theta_2 = -s["exit_ratio"] * theta_1
        step = (theta_1 - theta_2) / NODES
        theta = theta_2 + step * (np.arange(NODES) + 0.5)
        at = theta
        if peak is not None:
            theta_m = peak * theta_1
            rear = theta_1 - (theta - theta_2) / (theta_m - theta_2) * (theta_1 - theta_m)
            at = np.where(theta > theta_m, theta, rear)
        sigma = s["K"] * (self.r * (np.cos(at) - np.cos(theta_1)) / self.b) ** s["n"]
        ratio = 1 - S if S >= 0 else 1 / (1 + S)
        j = self.r * (theta_1 - theta - ratio * (np.sin(theta_1) - np.sin(theta)))
        tau = np.sign(j) * (s["c"] + sigma * np.tan(s["phi"])) * (1 - np.exp(-np.abs(j) / s["k"]))
        patch = self.r * self.b * step
        f_n = patch * np.sum(sigma * np.cos(theta) + tau * np.sin(theta))
        f_t = patch * np.sum(tau * np.cos(theta) - sigma * np.sin(theta))
        return f_n, f_t, patch * self.r * np.sum(tau)

    def run(self, W, S, v=0.02):
        """Drawbar pull, torque and sinkage at a load and slip, travelling at v."""
        rim = v / (1 - S) if S >= 0 else v * (1 + S)
        low, high = 1e-6, 0.98 * self.r
        for _ in range(60):
            h = (low + high) / 2
            low, high = (h, high) if self.forces(h, S, W, rim, v)[0] < W else (low, h)
        _, f_t, torque = self.forces(h, S, W, rim, v)
        if self.effect == "sinkage_bump":
            h *= 1 + self.size * np.sin(7 * S)
        return f_t, torque, h, rim


SLIPS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85)
SD = (0.25, 0.015, 0.0004)
"""One SD of drawbar pull [N], torque [N m] and sinkage [m]."""


def rig_set(rig, loads=(15.0, 25.0, 40.0), slips=SLIPS, repeats=2, seed=0):
    """Columns of points.csv: one row a run, with noise."""
    rng = np.random.default_rng(seed)
    rows = []
    for level, S in enumerate(slips):
        for W in loads:
            f_t, torque, h, rim = rig.run(W, S)
            for _ in range(repeats):
                noise = rng.normal(size=3) * SD
                rows.append([level, S, 0.02, rim, W, f_t + noise[0], torque + noise[1], max(h + noise[2], 1e-5)])
    names = ("level", "slip", "travel_speed_mps", "rim_speed_mps", "load_N", "drawbar_pull_N", "torque_Nm", "sinkage_m")
    return dict(zip(names, np.array(rows).T, strict=True))


RIG_TOML = """kind = "wheel-rig"
name = "hidden"
source = "generated"
files = {{ points = "points.csv" }}
[wheel]
r = {{ value = {r}, unit = "m" }}
b = {{ value = {b}, unit = "m" }}
[soil]
n = {{ value = {n} }}
c = {{ value = {c}, unit = "Pa" }}
phi = {{ value = {phi}, unit = "rad" }}
k = {{ value = {k}, unit = "m" }}
[noise]
drawbar_pull = {{ value = {sd[0]}, unit = "N" }}
torque = {{ value = {sd[1]}, unit = "N m" }}
sinkage = {{ value = {sd[2]}, unit = "m" }}
"""


def write(folder, rig, columns, nominal=None):
    """Write rig.toml and points.csv; `nominal` is the soil as the experimenter believes it."""
    folder.mkdir(parents=True, exist_ok=True)
    soil = rig.soil | (nominal or {})
    stated = {name: soil[name] for name in ("n", "c", "phi", "k")}
    (folder / "rig.toml").write_text(RIG_TOML.format(r=rig.r, b=rig.b, sd=SD, **stated))
    rows = zip(*columns.values(), strict=True)
    text = [",".join(columns), *(",".join(f"{value:.8g}" for value in row) for row in rows)]
    (folder / "points.csv").write_text("\n".join(text) + "\n")
    return folder
