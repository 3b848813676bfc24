"""Steady points of a motor on a brake in plain NumPy, by bisection on the balance of torques; imports nothing of the
package.
"""

import numpy as np

GEAR, K_T, R, V = 200.0, 0.01, 20.0, 12.0
SD = (0.02, 0.003)
"""Of the rate [rad/s] and of the current [A]."""
HEADER = "run,duty,load_Nm,wheel_rate_radps,current_A,wheel_rate_sd_radps,current_sd_A"
MOTOR = f"""[motor]
gear = {{ value = {GEAR}, unit = "" }}
k_t = {{ value = {K_T}, unit = "N m/A" }}
resistance = {{ value = {R}, unit = "ohm" }}
supply = {{ value = {V}, unit = "V" }}
"""


def write(folder, seed, viscous=0.0, square=0.0, dead=0.0, resistance=1.03, runs=5, samples=6):
    """Write the points of a motor with a wrong resistance, and return the folder.

    The hidden effects are the friction viscous w + square w^2, and a driver that ignores duties below `dead`.
    """
    random, K = np.random.default_rng(seed), GEAR * K_T
    rows = [HEADER]
    for duty in np.linspace(0.3, 1.0, runs):
        for load in np.linspace(0.0, 0.4, samples) * K * V / R * duty:
            low, high = 0.0, 2.0 * V / K
            for _ in range(80):
                rate = (low + high) / 2
                current = (max(duty - dead, 0.0) * V - K * rate) / (resistance * R)
                slow = K * current - viscous * rate - square * rate * abs(rate) > load
                low, high = (rate, high) if slow else (low, rate)
            observed = np.array([rate, current]) + np.array(SD) * random.normal(size=2)
            rows.append(f"at {duty:.2f},{duty},{load},{observed[0]},{observed[1]},{SD[0]},{SD[1]}")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "points.csv").write_text("\n".join(rows) + "\n")
    (folder / "motor.toml").write_text(MOTOR)
    return folder
