"""The models that a user would write for the data of `oracle/benchmark_generator.py`, with laws that may be missing.

Each system has its hidden law among four or more others that act on the same channel. All equations are compiled.
"""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.discrepancy.experiment import Parts
from rover_pin.experiments.over_time import OverTime, record

G = 9.81


class System(OverTime):
    """An experiment in memory: declared parts, and the runs that the generator made."""

    is_symbolic = True

    @classmethod
    def of(cls, made):
        """Return the experiment of the arrays that the generator made."""
        time, inputs, measured, sd = made
        folds = tuple(f"run {at}" for at in range(len(time)))
        return cls(Parts({name: part() for name, part in cls.parts.items()}), folds, time, inputs, measured, sd)


VESSELS = {
    "k": (1.0e-5, "m^3/(s V)", 1e-7, 1e-3),
    "hole_1": (5.0e-5, "m^2", 1e-6, 1e-3),
    "hole_2": (5.0e-5, "m^2", 1e-6, 1e-3),
    "area": (0.01, "m^2", 1e-4, 1.0),
}


@dataclass(frozen=True, eq=False)
class Tanks(System):
    """Two tanks one above the other; the lower level is measured."""

    name, states, steps = "cascaded tanks", 2, 2
    columns = "time_s pump_V level_m level_sd_m".split()
    units: ClassVar = {"level": "m"}
    parts: ClassVar = {"vessels": record("Vessels", "two tanks", **(VESSELS | {"k": (2.4e-5, *VESSELS["k"][1:])}))}
    uncertainty: ClassVar = {f"vessels.{name}": 0.2 for name in VESSELS}
    free_start: ClassVar = {0: 0.05, 1: 0.05}
    laws = (
        record("Overflow", "water above the rim runs over, in part into the lower tank",
               spill=(5e-3, "m^2/s", 0.0, 1.0), rim=(0.2, "m", 0.02, 1.0), part=(0.5, "", 0.0, 1.0)),
        record("LowerOverflow", "the lower tank runs over",
               spill_2=(5e-3, "m^2/s", 0.0, 1.0), rim_2=(0.2, "m", 0.02, 1.0)),
        record("Leak", "the upper tank leaks in proportion to its level", leak=(2e-5, "m^2/s", 0.0, 1e-2)),
        record("PumpBend", "the pump's flow bends with the voltage", bend=(2e-6, "m^3/(s V^2)", -1e-4, 1e-4)),
        record("Evaporation", "water is lost at a constant rate", lost=(2e-6, "m^3/s", 0.0, 1e-3)),
        record("SensorBend", "the gauge is bent", gauge=(0.2, "1/m", -2.0, 2.0)),
    )  # fmt: skip

    def start(self, n):
        return (0.05, 0.05)

    def motion(self, n, state, *values):
        (h1, h2), (u,) = state, values
        h1, h2 = ca.fmax(h1, 1e-6), ca.fmax(h2, 1e-6)
        out1, out2 = n.hole_1 * ca.sqrt(2 * G * h1), n.hole_2 * ca.sqrt(2 * G * h2)
        over, over2 = n.spill * ca.fmax(h1 - n.rim, 0.0), n.spill_2 * ca.fmax(h2 - n.rim_2, 0.0)
        into = n.k * u + n.bend * u * u - out1 - over - n.leak * h1
        return (into / n.area, (out1 + n.part * over - out2 - over2 - n.lost) / n.area), (h2 + n.gauge * h2 * h2,)


@dataclass(frozen=True, eq=False)
class Spring(System):
    """A resonator driven by a force (or its electronic twin)."""

    name, states, steps = "resonator", 2, 4
    columns = "time_s force_N place_m place_sd_m".split()
    units: ClassVar = {"place": "m"}
    parts: ClassVar = {"body": record("Body", "mass, damper and spring", stiffness=(6e4, "N/m", 1e3, 1e6),
                                      damping=(10.0, "N s/m", 0.01, 1e3), mass=(1.0, "kg", 0.1, 10.0))}  # fmt: skip
    uncertainty: ClassVar = {"body.stiffness": 0.1, "body.damping": 0.3, "body.mass": 0.1}
    laws = (
        record("CubicSpring", "the spring gets stiffer", cubic=(2e8, "N/m^3", 0.0, 1e12)),
        record("SquareSpring", "the spring is stiffer on one side", square=(1e6, "N/m^2", -1e9, 1e9)),
        record("Coulomb", "dry friction", dry=(2.0, "N", 0.0, 1e3)),
        record("SquareDrag", "drag grows with the square of the rate", drag=(10.0, "N s^2/m^2", 0.0, 1e4)),
        record("ForceLimit", "the drive saturates smoothly", limit=(1e-5, "1/N^2", 0.0, 1e-2)),
        record("GaugeBend", "the gauge is bent", gauge=(10.0, "1/m", -500.0, 500.0)),
    )

    def motion(self, n, state, *values):
        (q, v), (u,) = state, values
        back = n.stiffness * q + n.cubic * q**3 + n.square * q * q + n.damping * v
        resist = n.dry * ca.tanh(v / 0.01) + n.drag * ca.fabs(v) * v
        return (v, (u / (1 + n.limit * u * u) - back - resist) / n.mass), (q + n.gauge * q * q,)


@dataclass(frozen=True, eq=False)
class Servo(System):
    """A shaft with a motor and a known load."""

    name, states, steps = "servo", 1, 10
    columns = "time_s current_A load_Nm rate_radps rate_sd_radps".split()
    units: ClassVar = {"rate": "rad/s"}
    parts: ClassVar = {"shaft": record("Shaft", "rotor and load", inertia=(0.02, "kg m^2", 1e-3, 1.0),
                                       viscous=(0.03, "N m s", 1e-4, 1.0),
                                       torque=(0.9, "N m/A", 0.05, 10.0))}  # fmt: skip
    uncertainty: ClassVar = {"shaft.inertia": 0.1, "shaft.viscous": 0.3, "shaft.torque": 0.05}
    laws = (
        record("LoadStribeck", "friction falls with the rate and rises with the load", load_share=(0.3, "", 0.0, 2.0),
               at_rest=(0.05, "N m", 0.0, 2.0), w_s=(2.0, "rad/s", 0.1, 50.0), rest=(0.5, "", 0.0, 1.0)),
        record("Coulomb", "dry friction", dry=(0.1, "N m", 0.0, 5.0)),
        record("Stribeck", "dry friction falls with the rate", stick=(0.1, "N m", 0.0, 5.0),
               w_t=(2.0, "rad/s", 0.1, 50.0), left=(0.5, "", 0.0, 1.0)),
        record("LoadFriction", "friction rises with the load", share=(0.2, "", 0.0, 2.0)),
        record("LoadBias", "the load sensor is off", bias=(0.1, "N m", -2.0, 2.0)),
        record("Saturation", "the motor saturates", sat=(0.01, "1/A^2", 0.0, 0.5)),
    )  # fmt: skip

    def motion(self, n, state, *values):
        (w,), (i, load) = state, values
        falling = n.rest + (1 - n.rest) * ca.exp(-((w / n.w_s) ** 2))
        # A number that makes the whole law vanish comes first; friction at rest without load belongs to it.
        loaded = n.load_share * (ca.fabs(load) + n.at_rest / 0.3) * falling
        plain = n.dry + n.stick * (n.left + (1 - n.left) * ca.exp(-((w / n.w_t) ** 2))) + n.share * ca.fabs(load)
        drive = n.torque * i / (1 + n.sat * i * i)
        return ((drive - load - n.bias - n.viscous * w - (loaded + plain) * ca.tanh(w / 0.02)) / n.inertia,), (w,)


@dataclass(frozen=True, eq=False)
class Hysteresis(System):
    """A resonator with a hidden state that a hysteretic force has."""

    name, states, steps = "hysteretic resonator", 3, 4
    columns = "time_s force_N place_m place_sd_m".split()
    units: ClassVar = {"place": "m"}
    parts: ClassVar = {"body": record("Body", "mass, damper and spring", stiffness=(5e4, "N/m", 1e3, 1e6),
                                      damping=(10.0, "N s/m", 0.01, 1e3), mass=(2.0, "kg", 0.1, 10.0))}  # fmt: skip
    uncertainty: ClassVar = {"body.stiffness": 0.3, "body.damping": 0.3, "body.mass": 0.1}
    laws = (
        record("BoucWen", "the force has memory", alpha=(5e4, "N/m", 0.0, 1e6), beta=(1e3, "1/m", 10.0, 1e5),
               gamma=(0.7, "", 0.05, 5.0), delta=(-0.3, "", -3.0, 3.0)),
        record("CubicSpring", "the spring gets stiffer", cubic=(1e9, "N/m^3", -1e13, 1e13)),
        record("Coulomb", "dry friction", dry=(5.0, "N", 0.0, 1e3)),
        record("SquareDrag", "drag grows with the square of the rate", drag=(20.0, "N s^2/m^2", 0.0, 1e5)),
        record("SquareSpring", "the spring is stiffer on one side", square=(1e6, "N/m^2", -1e9, 1e9)),
    )  # fmt: skip

    def motion(self, n, state, *values):
        (q, v, z), (u,) = state, values
        # z is the hysteretic force over alpha: z' = v - beta (gamma |v| z + delta v |z|).
        dz = v - n.beta * (n.gamma * ca.fabs(v) * z + n.delta * v * ca.fabs(z))
        back = n.stiffness * q + n.cubic * q**3 + n.square * q * q + n.damping * v + n.alpha * z
        resist = n.dry * ca.tanh(v / 0.005) + n.drag * ca.fabs(v) * v
        return (v, (u - back - resist) / n.mass, dz), (q,)


@dataclass(frozen=True, eq=False)
class DcMotor(System):
    """A motor that is driven by a voltage."""

    name, states, steps = "motor", 2, 4
    columns = "time_s voltage_V rate_radps rate_sd_radps".split()
    units: ClassVar = {"rate": "rad/s"}
    parts: ClassVar = {"motor": record("Rotor", "rotor and winding", inertia=(0.003, "kg m^2", 1e-4, 0.1),
                                       viscous=(0.005, "N m s", 1e-5, 0.1), k_t=(0.2, "N m/A", 0.01, 2.0),
                                       resistance=(1.7, "ohm", 0.1, 50.0))}  # fmt: skip
    uncertainty: ClassVar = {"motor.inertia": 0.1, "motor.viscous": 0.3, "motor.k_t": 0.1}
    delays: ClassVar = {"voltage_V": "wait"}
    laws = (
        record("DeadTime", "the motor answers late", wait=(0.1, "s", 0.0, 1.0)),
        record("Coulomb", "dry friction", dry=(0.05, "N m", 0.0, 2.0)),
        record("Lag", "the driver lags", share=(0.5, "", 0.0, 1.0), tau=(0.1, "s", 0.02, 2.0)),
        record("Sag", "the supply sags under load", sag=(0.2, "ohm", 0.0, 10.0)),
        record("Bias", "a weight pulls", pull=(0.05, "N m", -1.0, 1.0)),
    )

    def motion(self, n, state, *values):
        (w, lagged), (u,) = state, values
        drive = (1 - n.share) * u + n.share * lagged
        current = (drive - n.k_t * w) / (n.resistance + n.sag)
        torque = n.k_t * current - n.viscous * w - n.dry * ca.tanh(w / 0.05) - n.pull
        return (torque / n.inertia, (u - lagged) / n.tau), (w,)


SYSTEMS = {"tanks": Tanks, "spring": Spring, "servo": Servo, "hysteresis": Hysteresis, "motor": DcMotor}
