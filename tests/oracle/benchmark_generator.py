"""Data of the kinds of public benchmarks of nonlinear identification, with invented numbers; nothing of the package.

Five systems: two cascaded tanks of which the upper one overflows, a resonator with a cubic spring, a servo whose dry
friction falls with the rate and rises with the load, a resonator with Bouc-Wen hysteresis, and a motor with a dead
time. Each hides one effect, or an effect that is on no list, or none. All are integrated by Heun's rule with small
steps in plain NumPy, all runs at once; the inputs are held between samples.
"""

import numpy as np

G = 9.81


def noise_like(random, samples, runs, slow, low=-1.0, high=1.0):
    """Held random levels that change every `slow` samples, evenly between two ends (samples, runs)."""
    levels = random.uniform(low, high, (samples // slow + 1, runs))
    return np.repeat(levels, slow, axis=0)[:samples]


def multisine(random, samples, runs, period, lines, low=1):
    """A sum of sines of equal size and random phases (samples, runs), of RMS 1; `period` samples are one period."""
    t, k = np.arange(samples)[:, None, None], np.arange(low, lines + 1)[:, None]
    phase = random.uniform(0, 2 * np.pi, (1, len(k), runs))
    total = np.zeros((samples, runs))
    for part in np.array_split(np.arange(samples), max(samples // 2000, 1)):
        total[part] = np.sin(2 * np.pi * k * t[part] / period + phase).sum(axis=1)
    return total / np.sqrt(len(k) / 2)


def integrated(rate, start, inputs, dt, parts):
    """States at each sample (states, samples, runs) of x' = rate(x, u), by Heun's rule with `parts` steps a sample."""
    x, h = np.array(start, float), dt / parts
    rows = np.empty((len(x), *inputs.shape))
    for sample, u in enumerate(inputs):
        rows[:, sample] = x
        for _ in range(parts):
            first = rate(x, u)
            x = x + h / 2 * (first + rate(x + h * first, u))
    return rows


def tanks(random, hidden, samples, runs):
    """Levels of two tanks that empty through holes; of the water that runs over, a part reaches the lower tank."""
    A, a1, a2, k, rim, part = 0.012, 5.2e-5, 5.6e-5, 2.6e-5, 0.185, 0.45
    u = noise_like(random, samples, runs, 25, 0.9, 4.6)
    dt = 4.0

    def rate(x, u):
        h1, h2 = np.maximum(x, 0.0)
        out1, out2 = a1 * np.sqrt(2 * G * h1), a2 * np.sqrt(2 * G * h2)
        over = 6e-3 * np.maximum(h1 - rim, 0.0) if hidden == "Overflow" else 0.0
        lost = 2.2e-6 * (h2 > 0.09) if hidden == "unlisted" else 0.0
        return np.array([(k * u - out1 - over) / A, (out1 + part * over - out2 - lost) / A])

    levels = integrated(rate, 0.05 * np.ones((2, runs)), u, dt, 4)
    # The lower level alone is measured, as in the benchmark.
    return dt, u, levels[1:2], np.array([0.0012])


def spring(random, hidden, samples, runs):
    """Displacement of a resonator."""
    m, c, k, k3 = 1.0, 9.0, 6.4e4, 2.7e8
    dt = 1.0 / 610
    u = 42.0 * multisine(random, samples, runs, 1024, 190)

    def rate(x, u):
        q, v = x
        extra = k3 * q**3 if hidden == "CubicSpring" else 3.4e4 * np.abs(q) * q * 40.0 if hidden == "unlisted" else 0.0
        return np.array([v, (u - c * v - k * q - extra) / m])

    return dt, u, integrated(rate, np.zeros((2, runs)), u, dt, 8)[:1], np.array([2.5e-5])


def servo(random, hidden, samples, runs):
    """Rate of a shaft that carries a changing load; its dry friction falls with the rate and rises with the load."""
    J, b, K, dt = 0.021, 0.033, 0.92, 0.01
    current = noise_like(random, samples, runs, 40, -3.2, 3.2)
    load = noise_like(random, samples, runs, 90, -1.1, 1.1)

    def rate(x, u):
        (w,), i, carried = x, u[0], u[1]
        dry = 0.0
        if hidden == "LoadStribeck":
            dry = (0.05 + 0.42 * np.abs(carried)) * (0.45 + 0.55 * np.exp(-((w / 2.3) ** 2)))
        if hidden == "unlisted":
            dry = 0.004 * w * w
        return np.array([(K * i - carried - b * w - dry * np.tanh(w / 0.02)) / J])

    inputs = np.stack([current, load], axis=1)
    x, rows, h = np.zeros((1, runs)), np.empty((1, samples, runs)), dt / 20
    for sample, u in enumerate(inputs):
        rows[:, sample] = x
        for _ in range(20):
            first = rate(x, u)
            x = x + h / 2 * (first + rate(x + h * first, u))
    return dt, np.stack([current, load], axis=-1), rows, np.array([0.05])


def hysteresis(random, hidden, samples, runs):
    """Displacement of a resonator whose restoring force has memory; Bouc-Wen's equation has no approximation in it."""
    m, c, k = 2.1, 11.0, 4.6e4
    dt, alpha, beta, gamma = 1.0 / 750, 5.3e4, 980.0, 0.79
    u = 120.0 * multisine(random, samples, runs, 2048, 270, 14)

    def rate(x, u):
        q, v, z = x
        dz = alpha * v - beta * (gamma * np.abs(v) * z - 0.21 * v * np.abs(z)) if hidden == "BoucWen" else 0.0 * z
        extra = 9.0 * np.sqrt(np.abs(v)) * np.sign(v) if hidden == "unlisted" else z
        return np.array([v, (u - c * v - k * q - extra) / m, dz])

    return dt, u, integrated(rate, np.zeros((3, runs)), u, dt, 8)[:1], np.array([8e-6])


def motor(random, hidden, samples, runs):
    """Rate of a motor; dead time: it answers to the voltage of some time before."""
    J, b, K, R, dt, dead = 0.0031, 0.0052, 0.21, 1.7, 0.02, 0.13
    volts = noise_like(random, samples, runs, 30, -9.0, 9.0)
    parts = 20

    def rate(x, u):
        (w,) = x
        extra = 0.0009 * w * np.abs(w) * 0.2 if hidden == "unlisted" else 0.0
        return np.array([(K * (u - K * w) / R - b * w - extra) / J])

    fine = np.repeat(volts, parts, axis=0)
    late = round(dead / dt * parts) if hidden == "DeadTime" else 0
    fine = np.concatenate([np.repeat(fine[:1], late, axis=0), fine])[: len(fine)]
    x = integrated(rate, np.zeros((1, runs)), fine, dt / parts, 1)[:, ::parts]
    return dt, volts, x, np.array([0.35])


SYSTEMS = {
    "tanks": (tanks, "Overflow", 500),
    "spring": (spring, "CubicSpring", 1200),
    "servo": (servo, "LoadStribeck", 600),
    "hysteresis": (hysteresis, "BoucWen", 1500),
    "motor": (motor, "DeadTime", 500),
}
"""Name of each system -> its function, the effect that it can hide, and a usual number of samples of a run."""


def made(system, hidden, seed, runs=6, samples=None):
    """Return time (runs, samples), inputs and measured channels (runs, inputs or channels, samples), and the SDs."""
    make, _, usual = SYSTEMS[system]
    random = np.random.default_rng(seed)
    count = samples or usual
    dt, u, channels, sd = make(random, hidden, count, runs)
    u = u[..., None] if u.ndim == 2 else u
    measured = channels + sd[:, None, None] * random.normal(size=channels.shape)
    time = np.tile(dt * np.arange(count), (runs, 1))
    return time, np.moveaxis(u, (0, 1, 2), (2, 0, 1)), np.moveaxis(measured, (0, 1, 2), (1, 2, 0)), sd
