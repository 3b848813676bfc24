"""Measure the time of a call of the torque bounds of six wheels with their derivatives by the load, in microseconds.

    python studies/benchmarks/bounds.py [--quick]

Three methods give T_sat, T_lim and both derivatives of the same six loads: `TorqueBounds` compiled, the same function
in CasADi's interpreter, and scipy (`quad` for integrals, `brentq` for theta_1, central differences for derivatives).
The output includes their maximum relative difference. A time is the mean of a short loop, and the minimum over many
loops, so that a machine busy with other work still shows the cost of the call.
"""

from __future__ import annotations

import argparse
import math
import platform
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from rover_pin.control.torque_bounds import BY_LOAD, TorqueBounds, WheelBounds, interpreted_bounds, torque_bounds
from rover_pin.parameters import NEXUS6_WHEEL, SOILS

WHEEL, SOIL, S_LIM = NEXUS6_WHEEL, SOILS["literature-sand"], 0.2
LOADS = np.array([7.9, 7.9, 7.3, 7.3, 12.6, 12.6])
STEP = 1e-4
"""Relative step of the central differences."""


def main() -> None:
    """Time the three methods, compare their results, and print both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer repeats")
    quick = parser.parse_args().quick
    prepared = TorqueBounds([WHEEL] * len(LOADS), SOIL, S_LIM)
    ways: dict[str, tuple[Callable[[], WheelBounds], int]] = {}
    # Without a C compiler, TorqueBounds falls back to CasADi's interpreter, and there is nothing compiled to time.
    if prepared.compiled:
        ways["TorqueBounds, compiled"] = (lambda: prepared(LOADS), 200)
    slower = without_compiler()
    ways["TorqueBounds, CasADi's machine"] = (lambda: slower(LOADS), 200)
    ways["scipy quad, brentq, differences"] = (by_scipy, 1)
    # scipy serves as the reference for accuracy as well as for time.
    reference = np.array(by_scipy())
    for name, (call, number) in ways.items():
        off = np.max(np.abs(np.array(call()) / reference - 1.0), axis=1)
        best = least(call, number, (20 if quick else 200) if number > 1 else 3)
        difference = f"from scipy: bounds {max(off[:2]):.0e}, derivatives {max(off[2:]):.0e}"
        print(f"{name:34s} {best:10.1f} us per call; {difference}")
    single = least(lambda: torque_bounds(9.5, SOIL, WHEEL, S_LIM), 100, 20)
    print(f"{'torque_bounds, one wheel of floats':34s} {single:10.1f} us per call")
    print(f"six wheels, T_sat, T_lim, dT_sat/dW, dT_lim/dW; {platform.machine()}, Python {platform.python_version()}")


def without_compiler() -> TorqueBounds:
    """Return the torque bounds without compilation, as on a computer that has no C compiler."""
    bounds = TorqueBounds([WHEEL] * len(LOADS), SOIL, S_LIM)
    bounds.bind(interpreted_bounds(len(LOADS), BY_LOAD))
    return bounds


def least(call: Callable[[], object], number: int, repeats: int) -> float:
    """Return the time of one call [us]: each repeat measures a mean time, and the smallest mean is returned."""
    best = math.inf
    for _ in range(repeats):
        # The mean of a short loop removes the cost of the clock; the minimum removes interruptions by other processes.
        start = time.perf_counter()
        for _ in range(number):
            call()
        best = min(best, (time.perf_counter() - start) / number)
    return 1e6 * best


def by_scipy() -> WheelBounds:
    """Return the torque bounds from adaptive quadrature, a bracketing root search and central differences."""
    rows = []
    for load in LOADS:
        step = STEP * load
        low, at, high = (np.array(one_by_scipy(load + d)) for d in (-step, 0.0, step))
        rows.append((*at, *((high - low) / (2.0 * step))))
    return WheelBounds(*np.array(rows).T)


def one_by_scipy(load: float) -> tuple[float, float]:
    """Return the torque bounds T_sat (soil failure) and T_lim (slip limit) of one wheel at one load."""
    return torque(lambda j: 1.0, load), torque(lambda j: -math.expm1(-j / SOIL.k), load)


def torque(share: Callable[[float], float], load: float) -> float:
    """Return the torque r^2 b int tau dtheta at the entry angle theta_1 that carries the load. The function `share`
    gives the mobilised fraction of the shear strength.
    """
    r, b = WHEEL.r, WHEEL.b

    # Bekker's normal stress at theta, for an arc that begins at theta_1.
    def sigma(theta: float, theta_1: float) -> float:
        return (SOIL.k_1 + SOIL.k_2 * b) * (r * max(math.cos(theta) - math.cos(theta_1), 0.0) / b) ** SOIL.n

    # Shear stress after the displacement j (Janosi and Hanamoto), limited by `share`.
    def tau(theta: float, theta_1: float) -> float:
        j = r * (theta_1 - theta - (1.0 - S_LIM) * (math.sin(theta_1) - math.sin(theta)))
        return (SOIL.c + sigma(theta, theta_1) * math.tan(SOIL.phi)) * share(j)

    # Vertical force minus load; its root is the entry angle.
    def force(theta_1: float) -> float:
        press = lambda t: sigma(t, theta_1) * math.cos(t) + tau(t, theta_1) * math.sin(t)  # noqa: E731
        return r * b * quad(press, -SOIL.exit_ratio * theta_1, theta_1, epsabs=0.0, epsrel=1e-11)[0] - load

    theta_1 = brentq(force, 0.05, 1.4, xtol=1e-13)
    return r * r * b * quad(tau, -SOIL.exit_ratio * theta_1, theta_1, args=(theta_1,), epsabs=0.0, epsrel=1e-11)[0]


if __name__ == "__main__":
    main()
