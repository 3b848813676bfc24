"""Effects that can be hidden: for each effect, its numbers at a severity. Severity 1 is hardly detectable.

Severities are drawn from 1 to 10 on a logarithmic scale. The sizes are assumed, from trials with a simple rover model
and from the package's ranges, so that severity 10 does not stop the rover. Nothing was tuned on the answers of the
loop.
"""

from math import radians

import numpy as np

from .vehicle import WHEELS


def either(random, value):
    return value if random.random() < 0.5 else -value


def wheel(random):
    return int(random.integers(6))


def patch(random, s):
    x_from, length = random.uniform(-0.2, 0.1), random.uniform(0.15, 0.35)
    return {"x_from": x_from, "length": length, "g": 0.15 * s, "g_k": 0.15 * s, "dphi": radians(0.3) * s}


def point_mass(random, s):
    kind = random.integers(3)
    if kind == 0:
        return {"m": either(random, 0.06 * s)}
    return {("shift_x", "shift_z")[kind - 1]: either(random, (0.0025, 0.004)[kind - 1] * s)}


def tacho(random, s):
    if random.random() < 0.5:
        return {"e": either(random, 0.006 * s)}
    return {"e": either(random, 0.012 * s), "wheel": WHEELS[wheel(random)]}


def bias(random, s):
    channel = ("body_pitch", "body_roll", "rocker_l", "bogie_l", "bogie_r")[random.integers(5)]
    return {"bias": either(random, 0.004 * s), "channel": channel}


SOIL = {
    "SlipSinkage": lambda random, s: {"n_1": 0.08 * s},
    "SkidSinkage": lambda random, s: {"n_s": 0.2 * s},
    "ExitAngle": lambda random, s: {"e_1": 0.08 * s},
    "PostPeak": lambda random, s: {"fraction": 0.04 * s, "S_w": random.uniform(0.2, 0.5)},
    "InterfaceFriction": lambda random, s: {"m": 1.0 - 0.03 * s},
    "Grousers": lambda random, s: {"h_s": 0.0006 * s},
    "Bulldozing": lambda random, s: {"share": 0.3 * s},
    "RateDependence": lambda random, s: {"c_r": either(random, 0.014 * s)},
    "MultiPass": lambda random, s: {"stiffening": 0.06 * s, "shear_stiffening": 0.06 * s},
    "LoadExponent": lambda random, s: {"n_h": 0.15 * s},
    "PeakStress": lambda random, s: {"share": 0.1 * s},
    "DiggingMemory": lambda random, s: {"c_d": 0.015 * s, "length": random.uniform(0.03, 0.05)},
    "HardPatch": patch,
    "WheelScale": lambda random, s: {"e": either(random, 0.006 * s)},
}
MOTOR = {
    "GearFriction": lambda random, s: {"tau_c": 0.01 * s},
    "ViscousFriction": lambda random, s: {"b_v": 0.004 * s},
    "DeadBand": lambda random, s: {"delta_0": 0.01 * s},
    "SupplySag": lambda random, s: {"R_b": 0.6 * s},
    "WindingHeating": lambda random, s: {"R_th": 25.0 * s, "tau": random.uniform(20.0, 80.0)},
    "WeakMotor": lambda random, s: {"g": 0.03 * s, "wheel": wheel(random)},
    "TorqueSaturation": lambda random, s: {"i_max": 0.08 * s**-0.35},
}
BODY = {
    "PivotFriction": lambda random, s: {"tau_c": 0.02 * s, "b": 0.01},
    "DifferentialCompliance": lambda random, s: {"compliance": 0.005, "backlash": 0.006 * s},
    "TetherDrag": lambda random, s: {"f_0": 0.1 * s, "f_1": 0.1 * s},
    "PointMass": point_mass,
    "GravityTilt": lambda random, s: {"rise_x": either(random, 0.0015 * s), "rise_y": either(random, 0.0005 * s)},
}
SENSOR = {
    "TachoScale": tacho,
    "TrackingDelay": lambda random, s: {"d": 0.03 * s},
    "VelocityFilter": lambda random, s: {"tau": 0.06 * s},
    "SensorBias": bias,
}
OFF_LIST = {
    "EccentricWheel": lambda random, s: {
        "A": 0.01 * s, "phase": random.uniform(0.0, 2 * np.pi), "wheel": wheel(random),
    },
    "Snag": lambda random, s: {"force": 0.5 * s},
    "LooseWheel": lambda random, s: {
        "hold": 0.1 * s**-0.6, "wheel": wheel(random), "phase": random.uniform(0.0, 2 * np.pi),
    },
    "Washboard": lambda random, s: {
        "A": 0.05 * s, "length": random.uniform(0.06, 0.2), "phase": random.uniform(0.0, 2 * np.pi),
    },
    "SlopeError": lambda random, s: {"per_m": either(random, 0.01 * s)},
}  # fmt: skip
"""On nobody's list; `SlopeError` bends the true ground away from the declared one."""
ALIASES = {"MotionResistance": lambda random, s: {"R": 0.01 * s}}
"""Only on request: the base model has this number itself."""
OTHER_LAWS = {
    "StribeckFriction": lambda random, s: {"tau_s": 0.02 * s},
    "SquareSag": lambda random, s: {"R_2": 4.0 * s},
    "SpringTether": lambda random, s: {"k": 0.4 * s},
}
"""Friction that falls with the rate, a supply that sags with the square of the current, a cable that is a spring."""
LISTED = SOIL | MOTOR | BODY
ALL = LISTED | SENSOR | OFF_LIST | ALIASES | OTHER_LAWS
SHARES = {"single": 0.40, "pair": 0.08, "none": 0.20, "off-list": 0.15, "sensor": 0.05, "other-law": 0.12}


def composition(count, shares, random):
    """Return the kind of each set in random order, with numbers as close to the shares as whole numbers allow."""
    full = {kind: int(count * share) for kind, share in shares.items()}
    fractions = {kind: count * share - full[kind] for kind, share in shares.items()}
    for kind in sorted(fractions, key=fractions.get, reverse=True)[: count - sum(full.values())]:
        full[kind] += 1
    kinds = [kind for kind, number in full.items() for _ in range(number)]
    return [kinds[i] for i in random.permutation(count)]


def dealt(names, count, random):
    """Return names in shuffled rounds, so that no name is missing while another occurs twice."""
    deck = []
    while len(deck) < count:
        deck += [names[i] for i in random.permutation(len(names))]
    return deck[:count]


def truth(name, random):
    """Return one hidden effect: its name, its severity and its numbers."""
    severity = float(10.0 ** random.uniform(0.0, 1.0))
    return {"effect": name, "severity": severity, "numbers": ALL[name](random, severity)}
