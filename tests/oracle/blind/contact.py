"""Forces of a piece of ground on a wheel: the base laws and every hidden effect of soil and rim, on flat arrays."""

from typing import NamedTuple

import numpy as np

from . import soil as soils

GATHERED = (
    "c", "phi", "k", "k_1", "n", "theta_1", "theta_2", "exit_ratio", "r", "b", "relaxation", "ringing", "damping", "R",
    "v_0", "rest", "rest_q", "side", "travel_speed",
)  # fmt: skip
SIDEWAYS_SHARE, LEAST_SHARE, EDGE = 0.05, 0.05, 0.005


class Load(NamedTuple):
    """Loads whose forward direction is that of the world, whatever the direction of travel."""

    f_t: np.ndarray
    f_y: np.ndarray
    f_n: np.ndarray
    torque: np.ndarray
    S: np.ndarray
    along_rate: np.ndarray
    across_rate: np.ndarray
    dug_rate: np.ndarray


SIGNS = (-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0)


class Contact:
    """The contact laws of one batch. Only the effects that act in at least one run are computed."""

    def __init__(self, world):
        self.world = world
        effects = {name.split(".")[0] for name in world.values if "." in name and world.has(name)}
        self.effects = effects
        taken = [name for name in world.values if "." in name and name.split(".")[0] in effects]
        self.names = [*GATHERED, *taken]
        self.table = np.stack([world[name] for name in self.names])
        self.bends = bool(effects & {"SlipSinkage", "SkidSinkage", "LoadExponent"}) or np.any(world["n"] != 1.0)
        self.moving = bool(effects & {"ExitAngle", "DiggingMemory"})
        self.strength = strength_fields(world.runs)

    def place(self, pieces, x, side):
        """Return the inputs of the law for pieces whose wheels [wheels x runs] are at x on a side (0 right, 1 left)."""
        runs = self.world.size
        run, wheel = pieces.wheel % runs, pieces.wheel // runs
        p = dict(zip(self.names, self.table.take(run, axis=1), strict=True))
        if "WheelScale" in self.effects:
            p["r"] = p["r"] * (1.0 + p["WheelScale.e"])
        p["h"], p["axle"] = pieces.h, np.array(self.world.vehicle.axles)[wheel]
        at = x.ravel()[pieces.wheel]
        p["x"], p["tan_phi"] = at, np.tan(p["phi"])
        if "HardPatch" in self.effects:
            stiff = patch(at, p["HardPatch.x_from"], p["HardPatch.length"])
            p["k_1"] = p["k_1"] * (1.0 + stiff * p["HardPatch.g"])
            p["k"] = p["k"] / (1.0 + stiff * p["HardPatch.g_k"])
            p["tan_phi"] = np.tan(p["phi"] + stiff * p["HardPatch.dphi"])
        if self.strength is not None:
            p["tan_phi"] = p["tan_phi"] * self.strength.at(at, side[wheel], run)
        p["sunk"], p["fixed"] = None, None
        if not self.moving:
            theta_1 = soils.entry_angle(p["h"], p["r"])
            p["sunk"] = soils.arc(theta_1, -p["exit_ratio"] * theta_1)
        if "ExitAngle" not in self.effects:
            p["fixed"] = soils.arc(p["theta_1"], p["theta_2"])
        return p

    def load(self, p, speeds, along, across, dug):
        """Return the load. If the travel speed is near 0, the load is a blend of both directions."""
        z = np.clip(0.5 * (speeds[0] + speeds[3]) / p["travel_speed"], -1.0, 1.0)
        sense = np.where(z < 0.0, -1.0, 1.0)
        load = self.sensed(p, sense, speeds, along, across, dug)
        both = np.flatnonzero(np.abs(z) < 1.0)
        if not len(both):
            return load
        part = {name: part_of(value, both) for name, value in p.items()}
        sub = self.sensed(part, -sense[both], speeds[:, both], along[both], across[both], dug[both])
        y = np.abs(z[both])
        most = 0.5 + 0.25 * y * (3.0 - y * y)
        mixed = []
        for array, second in zip(load, sub, strict=True):
            array = array.copy()
            array[both] = most * array[both] + (1.0 - most) * second
            mixed.append(array)
        return Load(*mixed)

    def sensed(self, p, sense, speeds, along, across, dug):
        v, v_y, approach, rim = speeds[0] * sense, speeds[1] * sense, speeds[2], speeds[3] * sense
        axle = np.where(sense > 0.0, p["axle"], self.world.vehicle.axles[-1] - p["axle"])
        load = self.law(p, axle, (v, v_y, approach, rim), along * sense, across * sense, dug)
        return Load(*(part if sign > 0.0 else part * sense for part, sign in zip(load, SIGNS, strict=True)))

    def law(self, p, axle, speeds, along, across, dug):
        """Return the load in the direction of travel."""
        on, r, b = self.effects, p["r"], p["b"]
        v, v_y, approach, rim = speeds
        rolling = np.maximum(np.abs(rim), np.abs(v))
        along_rate = (rim - v - rolling * along) / p["relaxation"]
        across_rate = (v_y - np.maximum(rolling, SIDEWAYS_SHARE * np.abs(v_y)) * across) / p["relaxation"]
        S = np.minimum(np.maximum(along + p["ringing"] * along_rate, -1.0), 1.0)
        S_y = across + p["ringing"] * across_rate

        h, tan_phi, c, k, K, n = p["h"], p["tan_phi"], p["c"], p["k"], p["k_1"], p["n"]
        ratio, theta_2, deeper = p["exit_ratio"], p["theta_2"], 0.0
        if "DiggingMemory" in on:
            h = np.maximum(h - dug, 0.0)
        if "SlipSinkage" in on:
            deeper = p["SlipSinkage.n_1"] * np.maximum(S, 0.0)
            n = np.minimum(n + p["SlipSinkage.n_1"] * np.maximum(S, 0.0), 3.0)
        if "SkidSinkage" in on:
            deeper = deeper + p["SkidSinkage.n_s"] * np.maximum(-S, 0.0)
            n = np.minimum(n + p["SkidSinkage.n_s"] * np.maximum(-S, 0.0), 3.0)
        if "LoadExponent" in on:
            n = np.clip(n + p["LoadExponent.n_h"] * h / b, 0.05, 3.0)
        if "ExitAngle" in on:
            change = p["ExitAngle.e_1"] * S
            ratio = np.clip(ratio + change, 0.0, 1.0)
            theta_2 = np.clip(theta_2 - change * p["theta_1"], -p["theta_1"], 0.0)
        if "InterfaceFriction" in on:
            tan_phi, c = p["InterfaceFriction.m"] * tan_phi, p["InterfaceFriction.m"] * c
        if "MultiPass" in on:
            K = K * (1.0 + axle * p["MultiPass.stiffening"])
            k = k / (1.0 + axle * p["MultiPass.shear_stiffening"])
        q = 1.0
        if "Grousers" in on:
            q = 1.0 + p["Grousers.lambda_s"] * p["Grousers.h_s"] / r
            S, k = lugged(S, q), k / q

        soil = {"c": c, "tan_phi": tan_phi, "k": k, "K": K, "n": n if self.bends else None}
        theta_1 = soils.entry_angle(h, r)
        travel = soils.travel_ratio(S)
        sunk = soils.arc(theta_1, -ratio * theta_1) if p["sunk"] is None else p["sunk"]
        fixed = soils.arc(p["theta_1"], theta_2) if p["fixed"] is None else p["fixed"]
        f_n, _ = soils.forces(sunk, travel, soil, r, b)
        share, torque = soils.forces(fixed, travel, soil, r, b)
        if "PeakStress" in on:
            arms = (theta_1, -ratio * theta_1), (p["theta_1"], theta_2)
            peaked = peak(S, arms, p, soil, f_n, torque / share)
        torque = torque / share * f_n
        paid = np.where(torque > 0.0, 1.0 + np.minimum(S, 0.0), 1.0)  # r omega / v: the soil gives no work
        f_t = paid * torque / r
        damped = np.maximum(0.0, 1.0 + p["damping"] * approach)
        f_n, f_t, torque = f_n * damped, f_t * damped, torque * damped
        sense = v / np.sqrt(v * v + p["v_0"] ** 2)
        fades = p["rest"] * (p["rest"] / np.hypot(p["rest"], rim)) ** p["rest_q"]
        firm = v / np.hypot(v, fades)
        f_t = f_t - p["R"] * f_n * sense
        f_y = side_force(S_y, f_n, f_t, r * (1.0 + ratio) * theta_1, p, soil)

        if "MotionResistance" in on:
            f_t = f_t - p["MotionResistance.R"] * f_n * sense
        if "DiggingMemory" in on:
            f_t = f_t - f_n * dug / p["DiggingMemory.length"] * firm
        if np.any(deeper):
            f_t = f_t - soils.rut(h, ratio, n, deeper, K, r, b) * firm
        if "Bulldozing" in on:
            f_t = f_t - p["Bulldozing.share"] * b * bank(h, np.arctan(tan_phi), c, p["Bulldozing.gamma"]) * firm
        if "PeakStress" in on:
            grown, extra = peaked
            carried = (1.0 + grown) * f_n * extra
            f_n, f_y, f_t, torque = ((1.0 + grown) * force for force in (f_n, f_y, f_t, torque))
            f_t, torque = f_t + paid * carried / r, torque + carried
        gain = 0.0
        if "PostPeak" in on:
            gain = -p["PostPeak.fraction"] * (1.0 - np.exp(-((S / p["PostPeak.S_w"]) ** 2)))
        if "RateDependence" in on:
            slide = np.log1p(np.abs(rim - v) / p["RateDependence.v_0"])
            gain = (1.0 + gain) * (1.0 + p["RateDependence.c_r"] * slide) - 1.0
        if "Washboard" in on:
            wave = np.sin(2 * np.pi * p["x"] / p["Washboard.length"] + p["Washboard.phase"])
            gain = (1.0 + gain) * (1.0 + p["Washboard.A"] * wave) - 1.0
        f_t, f_y, torque = f_t + gain * paid * torque / r, f_y + gain * f_y, (1.0 + gain) * torque
        f_t, torque = f_t + (q - 1.0) * paid * torque / r, q * q * torque

        dug_rate = np.zeros_like(v)
        if "DiggingMemory" in on:
            thrown = np.maximum(rim - v, 0.0) * np.minimum(h / 1e-4, 1.0)
            left = dug * v * firm / p["DiggingMemory.length"]
            dug_rate = p["DiggingMemory.c_d"] * thrown * (1.0 - 2.0 * dug / r) - left
        return Load(f_t, f_y, f_n, torque, S, along_rate, across_rate, dug_rate)


def side_force(S_y, f_n, f_t, length, p, soil):
    j = 0.5 * S_y * length
    strength = soil["c"] * p["b"] * length + f_n * soil["tan_phi"]
    left = np.sqrt(np.maximum(strength**2 - f_t**2, (LEAST_SHARE * strength) ** 2))
    return -np.sign(j) * p["side"] * left * (1.0 - np.exp(-np.abs(j) / soil["k"]))


def lugged(S, q):
    """Return the slip of a rim that is q times as large: v / (r omega) is divided by q."""
    ratio = soils.travel_ratio(S) / q
    return np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)


def bank(h, phi, c, gamma):
    """Return the earth pressure on a plate of height h, for each metre of width."""
    tilt = np.pi / 4 - phi / 2
    cot = 1.0 / np.tan(tilt)
    return (cot + np.tan(tilt + phi)) * (c * h + (cot + cot**2 * np.tan(phi)) * gamma * h**2 / 2)


def peak(S, arms, p, soil, f_n, factor):
    """Return the relative increase of f_n, and the change of torque / (r f_n) that follows, times r."""
    r, b, share = p["r"], p["b"], p["PeakStress.share"]
    peaks = []
    for theta_1, theta_2 in arms:
        edge = 0.02 * (theta_1 - theta_2)
        theta_m = (p["PeakStress.a_0"] + p["PeakStress.a_1"] * S) * theta_1
        theta_m = np.clip(theta_m, theta_2 + edge, theta_1 - edge)
        peaks.append(soils.peaked_forces(S, theta_1, theta_m, theta_2, soil, r, b))
    grown = share * (peaks[0][0] / f_n - 1.0)
    ratio = share * peaks[0][0] / f_n
    return grown, ratio / (1.0 + grown) * (peaks[1][1] / peaks[1][0] - factor)


def patch(x, x_from, length):
    """Return 1 on the patch and 0 outside, with edges that are 10 mm wide."""
    return 0.5 * (np.tanh((x - x_from) / EDGE) - np.tanh((x - x_from - length) / EDGE))


def part_of(value, index):
    if isinstance(value, soils.Arc):
        return soils.Arc(*(array[:, index] for array in value))
    return None if value is None else value[index]


class Fields(NamedTuple):
    """Factors of tan phi on an evenly spaced grid along x [runs, sides, points]."""

    first: np.ndarray
    gap: np.ndarray
    values: np.ndarray

    def at(self, x, side, run):
        place = np.clip((x - self.first[run]) / self.gap[run], 0.0, self.values.shape[2] - 1.001)
        low = place.astype(int)
        part = place - low
        return (1.0 - part) * self.values[run, side, low] + part * self.values[run, side, low + 1]


def strength_fields(runs):
    if all(run.strength is None for run in runs):
        return None
    points = max(np.shape(run.strength)[-1] for run in runs if run.strength is not None)
    values = np.ones((len(runs), 2, points))
    for b, run in enumerate(runs):
        if run.strength is not None:
            values[b] = np.pad(run.strength, ((0, 0), (0, points - np.shape(run.strength)[-1])), mode="edge")
    first, gap = (np.array([run.field_x[i] for run in runs]) for i in (0, 1))
    return Fields(first, gap, values)
