"""Plan one data set: six drives of 20 s on a bed with four lanes, the true numbers, and the declarations of its log.

From right to left, the lanes of the bed are level, a ramp up and down, and waves that differ between the left and the
right wheels. The true ground is the declared ground plus a small relief, which is drawn anew for every run. The
strength of the soil varies along the path.
"""

from math import radians

import numpy as np

from . import circumstance
from .vehicle import NEXUS6
from .world import PLAIN, Run

DURATION, HOLD, ROWS = 20.0, 0.05, 401
FLAT, RAMP, WAVES = -0.8, 0.0, 0.8
"""y of the lanes' middles [m]."""
BORDERS = (-0.4, 0.4, WAVES)
X = np.round(np.arange(-1.6, 1.601, 0.04), 6)
"""Declared points of the ground; the true ones are twice as close."""
FINE = np.round(np.arange(-1.6, 1.601, 0.02), 6)
RELIEF_SLOPE, RELIEF_LENGTH = radians(0.3), 0.04
STRENGTH_SD, STRENGTH_LENGTH = 0.03, 0.08
WAY = 0.5
"""Runs start this far before or behind the middle."""
MOTOR = {"supply": 7.2, "resistance": 23.852966947475586, "k_t": 0.0125, "gear": 265.03296608306204,
         "rotor_inertia": 1.4315213509269268e-08}  # fmt: skip
SD = {"phi": radians(0.8), "k": 0.12, "k_1": 0.10, "gear": 0.02, "resistance": 0.02}
"""Of the truth about the nominal: phi in rad, the others relative."""
MOST = {"phi": radians(1.5), "k": 0.25, "k_1": 0.20, "gear": 0.04, "resistance": 0.04}
WRONG_SD = {"phi": radians(2.0), "k": 0.25, "k_1": 0.25}
"""By how much more a wrong nominal soil is off."""
WRONG_MOST = {"phi": radians(4.0), "k": np.log(1.6), "k_1": np.log(1.6)}
MOTOR_SPREAD, TACHO_SPREAD = 0.012, 0.01
UNLIKE = {"motor_gain": 0.03, "tacho_gain": 0.02}
"""What a motor's or a tachogenerator's gain differs by at most, all of it alike probable."""
RESISTANCE, FADES = (0.02, 0.10), (0.0005, 0.008)
"""Share of the load that wheels take to roll, and speed below which that fades [m/s], log-uniform whatever the soil; no
log tells them. Sources: 0.02 a firm track, 0.10 loose sand under light wheels, assumed."""


def draw(random, sd, most):
    """Return a normal random number, drawn again until it lies within +-`most`."""
    while abs(value := sd * random.standard_normal()) > most:
        pass
    return value


def nuisance(random, wrong, vehicle=NEXUS6):
    """Return the true numbers of the set, and the declared numbers of soil and motor in proportion to the rover."""
    off = {name: draw(random, SD[name], MOST[name]) for name in SD}
    true = {"phi": PLAIN["phi"] + off["phi"]} | {name: PLAIN[name] * np.exp(off[name]) for name in ("k", "k_1")}
    true["constant"] = MOTOR["k_t"] * MOTOR["gear"] * np.exp(off["gear"])
    true["resistance"] = MOTOR["resistance"] * np.exp(off["resistance"])
    true |= {name: np.exp(random.uniform(*np.log(ends))) for name, ends in (("R", RESISTANCE), ("v_0", FADES))}
    identification = {name: PLAIN[name] for name in ("phi", "k", "k_1")}
    sd = {name: SD[name] for name in identification}
    if wrong:
        deviation = {name: draw(random, WRONG_SD[name], WRONG_MOST[name]) for name in identification}
        identification = {"phi": identification["phi"] + deviation["phi"]} | {
            name: identification[name] * np.exp(deviation[name]) for name in ("k", "k_1")
        }
        sd = {name: float(np.hypot(SD[name], WRONG_SD[name])) for name in identification}
    gains = {name: (1.0 + random.uniform(-most, most, 6)).tolist() for name, most in UNLIKE.items()}
    gains = {name: [values[at] for at in vehicle.taken] for name, values in gains.items()}
    kinds = {"k": "length", "k_1": "Pa", "constant": "length", "resistance": "ohm"}
    true |= {name: true[name] * vehicle.ratio(kind) for name, kind in kinds.items()}
    declaration = declared(identification, sd, vehicle)
    return (
        {name: float(value) for name, value in true.items()},
        gains,
        {name: declaration[name] for name in ("soil", "motor")},
    )


def declared(message, sd, vehicle=NEXUS6):
    """Return the tables [soil] and [motor] of the log; `said` and `sd` hold for the wheels of Nexus 6."""
    message = message | {name: message[name] * vehicle.ratio(kind) for name, kind in (("k", "length"), ("k_1", "Pa"))}
    kinds = {"resistance": "ohm", "gear": "length", "rotor_inertia": "current"}
    constants = {name: value * vehicle.ratio(kinds[name]) if name in kinds else value for name, value in MOTOR.items()}
    soil = {
        "phi": {"value": round(np.degrees(message["phi"]), 2), "unit": "deg", "sd": round(np.degrees(sd["phi"]), 2)},
        "k": {"value": round(1e3 * message["k"], 3), "unit": "mm", "sd": round(1e3 * message["k"] * sd["k"], 3)},
        "k_1": {"value": round(message["k_1"], 0), "unit": "Pa", "sd": round(message["k_1"] * sd["k_1"], 0)},
        "c": {"value": PLAIN["c"] * vehicle.ratio("Pa"), "unit": "Pa"},
        "n": {"value": PLAIN["n"]},
        "theta_1": {"value": 35.0, "unit": "deg"},
        "theta_2": {"value": -5.0, "unit": "deg"},
    }
    units = {"supply": "V", "resistance": "ohm", "k_t": "N m/A", "rotor_inertia": "kg m^2"}
    motor = {n: {"value": value} | ({"unit": units[n]} if n in units else {}) for n, value in constants.items()}
    for name in ("gear", "resistance"):
        motor[name]["sd"] = float(f"{constants[name] * SD[name]:.4g}")
    soil = {name: plain(table) for name, table in soil.items()}
    return {"soil": soil, "motor": motor, "resistance": {"q": {"value": 0.0}}}  # it fades below v_0, wheels turn or not


def plain(table):
    return {name: float(value) if isinstance(value, np.floating) else value for name, value in table.items()}


def bed(random):
    """Return the declared heights of the four lanes [m] at the positions X."""
    steep = radians(random.uniform(6.0, 8.5))
    up, top = random.uniform(-0.30, -0.20), random.uniform(0.0, 0.12)
    length = random.uniform(0.28, 0.36)
    on, down = X - up, X - up - length - top
    slope = np.tan(steep) * (((on >= 0.0) & (on < length)) * 1.0 - ((down >= 0.0) & (down < length)))
    slope = np.convolve(slope, (0.25, 0.5, 0.25), mode="same")
    ramp = np.concatenate(([0.0], np.cumsum(slope[:-1] * np.diff(X))))
    return np.round([np.zeros(len(X)), ramp, waves(random), waves(random)], 5)


def waves(random):
    z = np.zeros(len(X))
    for length, steep in ((random.uniform(0.7, 1.1), radians(4.0)), (random.uniform(0.35, 0.55), radians(2.5))):
        size = random.uniform(0.6, 1.0) * np.tan(steep) * length / (2 * np.pi)
        z += size * np.sin(2 * np.pi * X / length + random.uniform(0.0, 2 * np.pi))
    return z


def smooth_noise(random, shape, length, x=FINE):
    """Return unit noise on x with a Gaussian correlation exp(-(d / length)^2 / 2)."""
    reach = int(np.ceil(4 * length / (x[1] - x[0])))
    at = np.arange(-reach, reach + 1) * (x[1] - x[0])
    kernel = np.exp(-((at / length) ** 2))
    kernel /= np.sqrt(np.sum(kernel**2))
    white = random.standard_normal((*shape, len(x) + 2 * reach))
    return np.apply_along_axis(lambda row: np.convolve(row, kernel, mode="valid"), -1, white)


def relief(random, x=FINE):
    """Return the relief under the right and the left wheels; its RMS slope is RELIEF_SLOPE."""
    rough = smooth_noise(random, (2,), RELIEF_LENGTH, x)
    slope = np.sqrt(np.mean((np.diff(rough, axis=1) / (x[1] - x[0])) ** 2))
    return rough * RELIEF_SLOPE / slope


def strength(random, x=FINE):
    """Return factors of the soil's strength along x under the right and the left wheels."""
    return 1.0 + STRENGTH_SD * smooth_noise(random, (2,), STRENGTH_LENGTH, x)


def holds(random, low=0.4, high=0.85, side=0.1):
    """Return random duties [ROWS, 6], held for 2.5 to 5 s."""
    duty, at = np.empty((ROWS, 6)), 0
    while at < ROWS:
        until = at + round(random.uniform(2.5, 5.0) / HOLD)
        duty[at:until] = random.uniform(low, high) + random.uniform(-side, side, 6)
        at = until
    return duty


def paused(random, duty):
    begin = round(random.uniform(6.0, 10.0) / HOLD)
    duty[begin : begin + round(random.uniform(2.0, 4.0) / HOLD)] = 0.0
    return duty


def reversed_part(random, duty):
    begin = round(random.uniform(7.0, 11.0) / HOLD)
    duty[begin : begin + round(random.uniform(4.0, 6.0) / HOLD)] *= -1.0
    return duty


def staircase(random):
    """Return duties that fall in steps from 0.8 to 0.1 and end at 0.5."""
    levels = np.array([0.8, 0.65, 0.5, 0.38, 0.27, 0.18, 0.10, 0.5])
    level = levels[np.minimum(np.arange(ROWS) * HOLD / (DURATION / len(levels)), len(levels) - 1).astype(int)]
    return level[:, None] * (1.0 + random.uniform(-0.08, 0.08, 6))


def weaving(random):
    """Return gentle steering to both sides, front against rear [ROWS, 4]."""
    t = np.arange(ROWS) * HOLD
    angle = random.uniform(0.06, 0.12) * np.sin(2 * np.pi * t / random.uniform(8.0, 12.0)) * np.minimum(t, 1.0)
    return angle[:, None] * np.array([1.0, 1.0, -1.0, -1.0])


def drives(random):
    """Return (name, purpose, lane, yaw, duty, steer) of the six runs, for six wheels of which four steer."""
    still, shared_duty = np.zeros((ROWS, 4)), holds(random)
    return (
        ("flat-1", "duty holds on the flat", FLAT, 0.0, shared_duty, still),
        ("flat-2", "replicate of flat-1 on sand raked again", FLAT, 0.0, shared_duty, still),
        ("ramp-up", "over the ramp, with a pause", RAMP, 0.0, paused(random, holds(random)), still),
        ("ramp-back", "over the ramp the other way, with a reversal", RAMP, np.pi,
         reversed_part(random, holds(random)), still),
        ("waves", "waves, other ones on either side, gently steered", WAVES, 0.0, holds(random), weaving(random)),
        ("stairs", "duty staircase over the waves the other way", WAVES, np.pi, staircase(random), still),
    )  # fmt: skip


def electric(set_index):
    """Return whether this set logs the currents and the battery's voltage, as every second set does."""
    return set_index % 2 == 0


def data_set(seed, index, kind, hidden, under="plain"):
    """Return the plan of the set: the runs, the declarations of the log, the errors of the sensors, and the truth.

    `under` is a circumstance, such as another rover. It does not change any other random choice of the set.
    """
    random = np.random.default_rng([seed, index, 1])
    vehicle = circumstance.vehicle(under)
    wrong = bool(random.random() < 0.5)
    true, gains, declared_soil = nuisance(random, wrong, vehicle)
    heights = bed(random)
    numbers, faults, bend = vehicle.base(PLAIN) | true | circumstance.numbers(under), {}, 0.0
    hidden = [cause | {"numbers": vehicle.sized(cause["effect"], cause["numbers"])} for cause in hidden]
    for cause in hidden:
        name, values = cause["effect"], cause["numbers"]
        if name in ("TachoScale", "TrackingDelay", "VelocityFilter", "SensorBias"):
            faults[name] = values
        elif name == "SlopeError":
            bend = values["per_m"]
        else:
            numbers |= {f"{name}.{key}": value for key, value in values.items()}
    runs = []
    for at, (name, purpose, lane, yaw, duty, steer) in enumerate(drives(random)):
        run_rng = np.random.default_rng([seed, index, 2, at])
        start = (-WAY if yaw == 0.0 else WAY, lane, yaw)
        pair = {FLAT: heights[[0, 0]], RAMP: heights[[1, 1]], WAVES: heights[[2, 3]]}[lane]
        z = np.array([np.interp(FINE, X, row) for row in pair]) + relief(run_rng) + bend * (FINE + WAY) ** 2 / 2
        run = Run(
            numbers,
            tuple((FINE, row) for row in z),
            (lane,),
            start,
            *vehicle.commands(duty, steer),
            gains["motor_gain"],
            (FINE[0], FINE[1] - FINE[0]),
            strength(run_rng),
            snags(run_rng),
        )
        runs.append((name, purpose, run))
    answer = {"kind": kind, "hidden": hidden, "wrong_nominal_soil": wrong, "true": true} | gains
    answer |= {"electric": electric(index), "under": under}
    read = {"under": under, "gravity": numbers.get("gravity", PLAIN["gravity"]), "noise": circumstance.noise(under)}
    read |= {"vehicle": vehicle}
    return {"runs": runs, "declared": declared_soil, "heights": heights, "faults": faults, "answer": answer} | read


def snags(random):
    """Return the times at which a cable catches: three to five times in a run, for 0.5 to 2 s."""
    count = int(random.integers(3, 6))
    begin = np.sort(random.uniform(2.0, 18.0, count))
    return tuple((float(b), float(d)) for b, d in zip(begin, random.uniform(0.5, 2.0, count), strict=True))
