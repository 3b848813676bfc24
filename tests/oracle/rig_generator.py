"""Wheel-rig sets with hidden effects in plain NumPy; imports nothing of rover_pin.

The forces are midpoint sums over the contact arc, and the load is balanced by bisection on the sinkage. Each effect is
written a second time from its published form, with its own parameter values.
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
    "bulldozing": 1.5,
    "grousers": 0.004,
    "interface_friction": 0.7,
    "skid_sinkage": 0.8,
    "slip_softening": 1.0,
    "ploughing": 1.0,
    "lug_trench": 0.004,
    "lyasko_sinkage": 0.8,
    "even_softening": 1.0,
    "strain_softening": 0.4,
    "power_rate": 0.15,
    "viscous_drag": 0.06,
    "bounded_hole": 0.1,
    "exit_root": 0.25,
    "early_peak": 0.8,
    "stiff_layer": 0.6,
    "slip_squared_drag": 0.12,
    "sinkage_bump": 0.25,
    "gain_drift": 0.6,
    "load_offset": 2.0,
    "bin_floor": 0.02,
    "sensor_wave": 0.0015,
    "second_day": 0.3,
}
"""Hidden effects at a clear size; from lyasko_sinkage on a cause of the list by another law, from slip_squared_drag on
what is on nobody's list."""

IS = {
    "slip_sinkage": "SlipSinkage",
    "exit_angle": "ExitAngle",
    "peak_stress": "PeakStress",
    "motion_resistance": "MotionResistance",
    "post_peak": "PostPeak",
    "rate_dependence": "RateDependence",
    "digging": "DiggingMemory",
    "bulldozing": "Bulldozing",
    "grousers": "Grousers",
    "interface_friction": "InterfaceFriction",
    "load_exponent": "LoadExponent",
    "skid_sinkage": "SkidSinkage",
}
"""Effects of the package by the hidden one that they are."""
WRONG = {"n": 1.0, "c": 0.0, "phi": 0.6, "k": 0.02}
"""A nominal soil that is not the hidden one."""
TWO_CHANNELS = """
kind = "wheel-rig"
[wheel]
r = { value = 62.5, unit = "mm" }
b = { value = 60, unit = "mm" }
[noise]
drawbar_pull = { value = 0.3, unit = "N" }
sinkage = { value = 0.6, unit = "mm" }
"""
"""A rig that measures neither torque nor speeds."""


class Rig:
    """A wheel, a soil, and one or several effects with their sizes: `Rig(sizes={"digging": 0.02, ...})`."""

    def __init__(self, effect="none", size=None, sizes=None, **soil):
        self.sizes = sizes or {effect: SIZES[effect] if size is None else size}
        self.effect, self.size = next(iter(self.sizes.items()))
        self.r, self.b = 0.0625, 0.06
        self.soil = {"c": 200.0, "phi": 0.5, "k": 0.008, "K": 9e4, "n": 1.1, "exit_ratio": 0.15} | soil

    def forces(self, h, S, W, rim, v, day=0):
        """Return normal force, drawbar pull and torque at the sinkage h."""
        dug = self.dug(rim, v)
        h = h - dug - self.trench(rim, v)
        if h <= 0:
            return 0.0, 0.0, 0.0
        s = self.ground(h, S, day)
        f_n, f_t, torque = self.sheared(h, S, s)
        sense = at_speed(v, rim)
        f_t -= f_n * dug / 0.04 * sense
        for effect, size in self.sizes.items():
            f_t, torque = after(effect, size, (f_n, f_t, torque), (h, S, rim, v, self.r, self.b, s, sense))
        return f_n, f_t, torque

    def dug(self, rim, v):
        """Return the depth of a digging wheel's hole, at which digging and rolling out balance, or of a hole that
        levels off.
        """
        thrown, left = self.sizes.get("digging", 0.0) * max(rim - v, 0.0), v * at_speed(v, rim) / 0.04
        bounded = self.sizes.get("bounded_hole", 0.0) * self.r * np.tanh(2 * max(rim - v, 0.0) / rim)
        return thrown / (left + 2 * thrown / self.r) + bounded

    def trench(self, rim, v):
        """Return the depth of the soil that lugs carry away: full pockets of this depth, levelling off
        towards r / 2.
        """
        cut = self.sizes.get("lug_trench", 0.0) * max(rim - v, 0.0)
        return cut / (v + 2 * cut / self.r)

    def ground(self, h, S, day):
        """Return the soil with the changes by the effects of this wheel."""
        s, size = dict(self.soil), self.sizes.get
        s["n"] += size("slip_sinkage", 0.0) * max(S, 0.0) + size("skid_sinkage", 0.0) * max(-S, 0.0)
        s["n"] += size("load_exponent", 0.0) * h / self.b
        s["exit_ratio"] = min(max(s["exit_ratio"] + size("exit_angle", 0.0) * S, 0.0), 1.0)
        s["c"] *= size("interface_friction", 1.0)
        s["phi"] = np.arctan(size("interface_friction", 1.0) * np.tan(s["phi"]))
        s["K"] *= 1 + size("second_day", 0.0) * day
        if "bin_floor" in self.sizes:
            s["K"] *= 1 + (h / self.sizes["bin_floor"]) ** 6
        pushed = 1 - (1 + min(S, 0.0)) ** size("ploughing", 0.0)
        s["K"] *= 1 - pushed
        s["exit_ratio"] = max(s["exit_ratio"] - 0.4 * pushed, -0.9)
        return self.otherwise(s, h, S)

    def otherwise(self, s, h, S):
        """Return the soil by laws that differ from the package's, except for slip-softening."""
        size, driving = self.sizes.get, max(S, 0.0)
        s["K"] *= np.exp(-size("slip_softening", 0.0) * driving * (2 - driving))
        s["K"] *= np.exp(-size("even_softening", 0.0) * abs(S))
        s["K"] *= ((1 + driving) / (1 - driving / 2)) ** (-s["n"] * size("lyasko_sinkage", 0.0))
        s["exit_ratio"] = min(max(s["exit_ratio"] + size("exit_root", 0.0) * np.sign(S) * abs(S) ** 0.5, -0.9), 1.0)
        s["n"] += size("stiff_layer", 0.0) * (1 - np.exp(-h / (0.3 * self.b)))
        return s

    def sheared(self, h, S, s):
        """Return the forces of the arc, with a share of Wong and Reece's stress and with shear at the radius of the
        lugs' middle.
        """
        q = 1 + 0.5 * self.sizes.get("grousers", 0.0) / self.r
        forces = np.array(self.arc(h, S, s, q))
        for effect, at in (("peak_stress", 0.4 + 0.15 * S), ("early_peak", 0.3 + 0.25 * S * abs(S))):
            share = self.sizes.get(effect, 0.0)
            if share:
                forces = (1 - share) * forces + share * np.array(self.arc(h, S, s, q, at))
        return forces

    def arc(self, h, S, s, q=1.0, peak=None):
        """Return midpoint sums over the arc; with `peak`, Wong and Reece's stress. The shear displacement is at the
        radius q r.
        """
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
        j = self.r * (q * (theta_1 - theta) - ratio * (np.sin(theta_1) - np.sin(theta)))
        tau = np.sign(j) * (s["c"] + sigma * np.tan(s["phi"])) * (1 - np.exp(-np.abs(j) / s["k"]))
        tau *= 1 - self.sizes.get("strain_softening", 0.0) * (1 - np.exp(-np.abs(j) / (5 * s["k"])))
        patch = self.r * self.b * step
        f_n = patch * np.sum(sigma * np.cos(theta) + tau * np.sin(theta))
        f_t = patch * np.sum(tau * np.cos(theta) - sigma * np.sin(theta) + (q - 1) * tau)
        return f_n, f_t, q * q * patch * self.r * np.sum(tau)

    def press(self, h):
        """Return the force of the wheel that is pressed in to the depth h without turning: no shear, and equal arcs in
        front and behind.
        """
        theta_1 = np.arccos(1 - h / self.r)
        theta = theta_1 * (2 * (np.arange(NODES) + 0.5) / NODES - 1)
        n = self.soil["n"] + self.sizes.get("load_exponent", 0.0) * h / self.b
        sigma = self.soil["K"] * (self.r * (np.cos(theta) - np.cos(theta_1)) / self.b) ** n
        return self.r * self.b * 2 * theta_1 / NODES * np.sum(sigma * np.cos(theta))

    def run(self, W, S, v=0.02, day=0, stiffer=1.0):
        """Return drawbar pull, torque and sinkage at a load and slip, at the travel speed v, in sand whose stiffness is
        multiplied by a factor.
        """
        if stiffer != 1.0:
            return Rig(sizes=self.sizes, **self.soil | {"K": stiffer * self.soil["K"]}).run(W, S, v, day)
        rim = v / (1 - S) if S >= 0 else v * (1 + S)
        low, high = 1e-6, 0.98 * self.r
        for _ in range(45):
            h = (low + high) / 2
            low, high = (h, high) if self.forces(h, S, W, rim, v, day)[0] < W else (low, h)
        _, f_t, torque = self.forces(h, S, W, rim, v, day)
        f_t += self.sizes.get("load_offset", 0.0) * (W / 25 - 1) ** 2
        h *= 1 + self.sizes.get("sinkage_bump", 0.0) * np.sin(7 * S)
        h += self.sizes.get("sensor_wave", 0.0) * np.sin(2 * np.pi * h / 0.006)
        return f_t, torque, h, rim


def at_speed(v, rim):
    """Return the share of a resistance that acts: all of it, except at wheels near rest."""
    return v / np.hypot(v, 0.001**2 / np.hypot(0.001, rim))


def after(effect, size, forces, at):
    """Return pull and torque with one effect that changes them directly."""
    (f_n, f_t, torque), (h, S, rim, v, r, b, s, sense) = forces, at
    shear = 0.0
    if effect == "motion_resistance":
        f_t -= size * f_n * v / np.hypot(v, 0.005**2 / np.hypot(0.005, rim))
    if effect == "post_peak":
        shear = -size * (1 - np.exp(-((S / 0.4) ** 2)))
    if effect == "rate_dependence":
        shear = size * np.log1p(abs(rim - v) / 0.01)
    if effect == "power_rate":
        shear = (1 + abs(rim - v) / 0.03) ** size - 1
    if effect == "viscous_drag":
        f_t -= size * f_n * v / 0.03
    if effect == "ploughing":
        X, phi = np.pi / 4 - np.pi / 12, np.pi / 6
        D_1, D_2 = 1 / np.tan(X) + np.tan(X + phi), 1 / np.tan(X) + np.tan(phi) / np.tan(X) ** 2
        wall = D_1 * (s["c"] * h + D_2 * 15700 * h * h / 2)
        f_t -= (1 - (1 + min(S, 0.0)) ** size) * b * wall * sense
    if effect == "bulldozing":
        X = np.pi / 4 - s["phi"] / 2
        D_1, D_2 = 1 / np.tan(X) + np.tan(X + s["phi"]), 1 / np.tan(X) + np.tan(s["phi"]) / np.tan(X) ** 2
        f_t -= size * b * D_1 * (s["c"] * h + D_2 * 15700 * h * h / 2) * sense
    if effect == "slip_squared_drag":
        f_t -= size * f_n * S * S
        torque += 0.8 * size * f_n * r * S * S
    return f_t + shear * torque / r, (1 + shear) * torque


SLIPS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85)
SD = (0.25, 0.015, 0.0004)
"""One SD of drawbar pull [N], torque [N m] and sinkage [m]."""
NAMES = ("level", "slip", "travel_speed_mps", "rim_speed_mps", "load_N", "drawbar_pull_N", "torque_Nm", "sinkage_m")


NOISES = ("white", "drifting", "spiked", "raked", "understated")
"""White; AR(1) from run to run, 0.8; one value in 30 six SD off; stiffness 4 % anew each level; 1.4 times the SD."""


def noisy(noise, white, rng):
    """Return noise of another kind, made from white noise of SD 1 (runs, channels) in the order of the runs."""
    if noise == "drifting":
        for before, now in zip(white[:-1], white[1:], strict=True):
            now[:] = 0.8 * before + 0.6 * now
    if noise == "spiked":
        white = white + 6 * rng.choice([-1.0, 1.0], white.shape) * (rng.uniform(size=white.shape) < 1 / 30)
    return 1.4 * white if noise == "understated" else white


def rig_set(rig, loads=(15.0, 25.0, 40.0), slips=SLIPS, repeats=2, seed=0, speeds=(0.02,), mixed=False, noise="white"):
    """Return the columns of points.csv, one row for each run, with noise. Repeats use the speeds in turn, and `mixed`
    runs are shuffled.
    """
    rng, raked = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    rows, white = [], []
    for level, S in enumerate(slips):
        stiffer = np.exp(0.04 * raked.normal()) if noise == "raked" else 1.0
        for W in loads:
            solved = {}
            for repeat in range(repeats):
                v, day = speeds[repeat % len(speeds)], repeat % 2 if "second_day" in rig.sizes else 0
                if (v, day) not in solved:
                    solved[v, day] = rig.run(W, S, v, day, stiffer)
                f_t, torque, h, rim = solved[v, day]
                white.append(rng.normal(size=3))
                rows.append([level, S, v, rim, W, f_t, torque, h])
    rows, white = np.array(rows), np.array(white)
    order = rng.permutation(len(rows)) if mixed else np.arange(len(rows))
    rows = rows[order]
    rows[:, 5:] += noisy(noise, white[order], rng) * SD
    rows[:, 7] = np.maximum(rows[:, 7], 1e-5)
    rows[:, 5] *= 1 + rig.sizes.get("gain_drift", 0.0) * np.linspace(-0.5, 0.5, len(rows))
    return dict(zip(NAMES, rows.T, strict=True))


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
    """Write rig.toml and points.csv. `nominal` is the soil that the experimenter declares."""
    folder.mkdir(parents=True, exist_ok=True)
    soil = rig.soil | (nominal or {})
    declared_soil = {name: soil[name] for name in ("n", "c", "phi", "k")}
    (folder / "rig.toml").write_text(RIG_TOML.format(r=rig.r, b=rig.b, sd=SD, **declared_soil))
    rows = zip(*columns.values(), strict=True)
    text = [",".join(columns), *(",".join(f"{value:.8g}" for value in row) for row in rows)]
    (folder / "points.csv").write_text("\n".join(text) + "\n")
    return folder
