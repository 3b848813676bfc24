"""A pendulum on a servo in plain NumPy, by Heun's rule at 0.2 ms, with steps of an encoder; imports nothing of the
package.

Every hidden law is stiffer than the package's: dry friction changes its sign within 0.004 rad/s, and the teeth of the
gear only push, with a damping that the package's law lacks.
"""

import numpy as np

G, STEP, SHARP = 9.81, 2e-4, 0.004
DECLARED = {
    "motor": {"gear": 60.0, "k_t": 0.025, "resistance": 4.0, "rotor_inertia": 2e-6, "supply": 12.0},
    "arm": {"stiffness": 40.0, "mass": 1.0, "lever": 0.25, "inertia": 0.08},
}
ENCODER = 2 * np.pi / 1024
"""Step of the angle [rad]; the rate and the current have noise of these SDs [rad/s, A]."""
RATE_SD, CURRENT_SD = 0.02, 0.01
SAMPLE, LENGTH, RUNS = 0.02, 2.0, 4
DAMPED = 0.02
"""Of the teeth's contact [N m s/rad]."""
LAWS = {
    "none": {},
    "Coulomb": {"T_c": (0.05, 0.3)},
    "Viscous": {"b": (0.04, 0.15)},
    "Stribeck": {"T_s": (0.15, 0.4), "share": (0.3, 0.6), "w_s": (0.3, 1.2)},
    "LoadFriction": {"mu": (0.05, 0.2)},
    "Play": {"gap": (0.02, 0.06)},
}
"""What is drawn of each law, evenly between these."""
HEADER = "run,time_s,voltage_V,angle_rad,rate_radps,current_A,angle_sd_rad,rate_sd_radps,current_sd_A"


def drawn(random, law):
    """Return the true numbers: the declared numbers with errors of up to 10 %, which are 2.5 SD of the package's
    priors, and the numbers of the hidden law.
    """
    off = random.uniform(0.9, 1.1, 4)
    motor, arm = DECLARED["motor"], DECLARED["arm"]
    K, R = motor["gear"] * motor["k_t"] * off[0], motor["resistance"] * off[1]
    numbers = {"K": K, "R": R, "weight": arm["mass"] * G * arm["lever"] * off[2], "arm": arm["inertia"] * off[3]}
    numbers["rotor"] = motor["gear"] ** 2 * motor["rotor_inertia"] * random.uniform(0.8, 1.2)
    numbers["stiffness"] = arm["stiffness"] * random.uniform(0.7, 1.4)
    return numbers, {key: random.uniform(*ends) for key, ends in LAWS[law].items()}


def voltages(random, length):
    """Return two sine waves for each run, from weak to strong (samples, runs), held from row to row."""
    t = np.arange(0.0, length, SAMPLE)[:, None]
    strength = np.linspace(1.5, 9.0, RUNS)
    slow, fast = random.uniform(0.3, 0.7, RUNS), random.uniform(0.9, 1.8, RUNS)
    phase = random.uniform(0.0, 2 * np.pi, (2, RUNS))
    return strength * (0.65 * np.sin(2 * np.pi * slow * t + phase[0]) + 0.35 * np.sin(2 * np.pi * fast * t + phase[1]))


def resisting(law, w, carried):
    """Return the friction against the rate w at a gear that carries this torque."""
    dry = law.get("T_c", 0.0) + law.get("mu", 0.0) * np.abs(carried)
    if "T_s" in law:
        dry = dry + law["T_s"] * (law["share"] + (1 - law["share"]) * np.exp(-np.square(w / law["w_s"])))
    return dry * np.tanh(w / SHARP) + law.get("b", 0.0) * w


def contact(lead, closing, numbers, gap):
    """Return the torque of the motor on the arm, from the lead of the motor and its rate. The teeth only push, at both
    ends of the gap.
    """
    push = numbers["stiffness"] * (np.abs(lead) - gap / 2) + DAMPED * np.sign(lead) * closing
    return np.where(np.abs(lead) > gap / 2, np.sign(lead) * np.maximum(push, 0.0), 0.0)


def slopes(state, u, numbers, law):
    """Return the time derivatives of the motor's angle and rate and of the arm's angle and rate."""
    motor, v, arm, w = state
    driving = numbers["K"] * (u - numbers["K"] * v) / numbers["R"]
    torque = contact(motor - arm, v - w, numbers, law.get("gap", 0.0))
    pulled = torque - resisting(law, w, torque) - numbers["weight"] * np.sin(arm)
    return np.array([v, (driving - torque) / numbers["rotor"], w, pulled / numbers["arm"]])


def simulated(u, numbers, law):
    """Return the angle of the arm, the rate of the shaft and the current (3, samples, runs), from rest."""
    state, rows = np.zeros((4, RUNS)), []
    for voltage in u:
        rows.append([state[2], state[1], (voltage - numbers["K"] * state[1]) / numbers["R"]])
        for _ in range(round(SAMPLE / STEP)):
            first = slopes(state, voltage, numbers, law)
            state = state + STEP / 2 * (first + slopes(state + STEP * first, voltage, numbers, law))
    return np.array(rows).transpose(1, 0, 2)


def of_truth(numbers):
    """Return the tables of bench.toml with the true numbers."""
    gear, mass = DECLARED["motor"]["gear"], DECLARED["arm"]["mass"]
    motor = {"k_t": numbers["K"] / gear, "resistance": numbers["R"], "rotor_inertia": numbers["rotor"] / gear**2}
    arm = {"lever": numbers["weight"] / (mass * G), "inertia": numbers["arm"], "stiffness": numbers["stiffness"]}
    return {"motor": DECLARED["motor"] | motor, "arm": DECLARED["arm"] | arm}


def write(folder, law="none", seed=0, noisy=True, length=LENGTH, true=False):
    """Write bench.toml, with declared or `true` numbers, and runs.csv; return the numbers of the hidden law, if there
    is one.
    """
    random = np.random.default_rng(seed)
    numbers, hidden = drawn(random, law)
    u = voltages(random, length)
    angle, rate, current = simulated(u, numbers, hidden)
    if noisy:
        angle = ENCODER * np.round(angle / ENCODER)
        rate, current = (
            rate + RATE_SD * random.normal(size=rate.shape),
            current + CURRENT_SD * random.normal(size=rate.shape),
        )
    rows, sd = [HEADER], f"{ENCODER / np.sqrt(12):.6f},{RATE_SD},{CURRENT_SD}"
    for run in range(RUNS):
        for k, voltage in enumerate(u[:, run]):
            observed = f"{angle[k, run]:.6f},{rate[k, run]:.6f},{current[k, run]:.6f}"
            rows.append(f"run {run},{k * SAMPLE:.3f},{voltage:.6f},{observed},{sd}")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "runs.csv").write_text("\n".join(rows) + "\n")
    tables = []
    for part, table in (of_truth(numbers) if true else DECLARED).items():
        tables.append(f"[{part}]\n" + "\n".join(f"{key} = {value}" for key, value in table.items()))
    (folder / "bench.toml").write_text("\n".join(tables) + "\n")
    return hidden
