"""Controllers of the package in a form that the compiled loop can run: numbers and C functions, so that Python need not
be called at every control instant.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.state import suspension_places


class SlipTable(NamedTuple):
    """Travel speed of the rover as a function of the duty. Eq (9) of the paper, the slip estimate, takes the travel
    speed from this table.
    """

    duty: Sequence[float]
    """duties of the table [-], ascending from 0"""
    speed: Sequence[float]
    """travel speed at each duty [m/s]"""
    r: float
    """wheel radius in Eq (9), which converts wheel rates to rim speeds [m]"""


class TorqueTable(NamedTuple):
    """Largest torques that the wheels may apply, as a function of the pitch, and the numbers of the motor that convert
    torques into duties.
    """

    pitches: np.ndarray
    "(pitches,) pitch angles [rad], ascending"
    torques: Sequence[Sequence[float]]
    """(pitches, wheels) largest torque of each wheel at each pitch [N m]"""
    stall_torque: float
    "stall torque of a motor at the wheel [N m]"
    no_load_rate: float
    "rate of a wheel at full duty without load [rad/s]"


class SlipLaw(NamedTuple):
    """A control law that computes the duty of a wheel from its slip. The compiled loop reads and updates the two
    memories of the law, `integral` and `depth`.
    """

    law: ca.Function
    """(slip estimate, integral, highest duty, wheel rate, travel speed, hole depth), gains -> duty, rates of change of
    integral and hole depth"""
    gains: Sequence[float]
    integral: np.ndarray
    """(wheels,) integral of the slip error over time, for the I part of the law"""
    depth: np.ndarray
    """(wheels,) estimated depth of the hole that each wheel has dug [m]"""
    period: float
    """time between two samples of the control [s]"""
    table: SlipTable | None
    """table for the estimate of the slip; None: the law gets the true slip of the simulation"""


class OnboardLaw(NamedTuple):
    """A slip estimate that uses only on-board sensors, as a C function with the arrays that it reads and writes. The
    Python object of the estimate owns these arrays, and must exist until the loop ends.
    """

    sense: int
    """address of the C function that updates the estimate; arguments: memory, sample, whether the duties drive the
    rover backwards, forward speed by visual odometry, which arrives late [m/s], or NaN"""
    belief: int
    """address of the memory of the estimate, which each call updates"""
    sample: np.ndarray
    """input: roll and pitch [rad], suspension angles [rad], wheel rates [rad/s], motor currents [A]"""
    slips_and_holes: np.ndarray
    """(wheels, 4) output: slip [-], standard deviation of the slip, depth of the hole that the wheel has dug [m],
    standard deviation of the depth [m]"""
    p_stands: int
    """address of the estimated probability that the rover does not move"""
    backwards: float
    """the rover counts as driving backwards if its largest duty is below this value"""
    rim_radius: float
    """wheel radius [m], for control laws whose desired slip depends on the depth of the holes; 0 for all other laws"""


class StopLaw(NamedTuple):
    """Condition of a control with an `OnboardLaw` for a final stop, because the rover is stuck. The function `stops` in
    tables.c evaluates the condition.
    """

    p: float
    """a sample counts as a sample without motion if the estimated probability that the rover does not move exceeds this
    value"""
    law: np.ndarray
    """three numbers: weight of a new sample in the running average of samples without motion; maximum average before
    the control stops; maximum ratio of the deepest hole to the wheel radius before the control stops"""
    memory: np.ndarray
    """two numbers, read and written: running average of samples without motion; a number above 0 if the control has
    stopped"""


class SensorNoise(NamedTuple):
    """Noise and quantisation of the sensors whose readings a controller gets. The entries of the arrays belong to
    attitude, wheel rates, motor currents and joint angles, in this order.
    """

    sds: np.ndarray
    """(4,) standard deviations of the noise"""
    steps: np.ndarray
    """(4,) quantisation steps; 0: the reading is not quantised"""
    random: np.random.Generator


class DriveLaw(NamedTuple):
    """A control law of the whole rover, which computes duties and steering angles from the position and from sensor
    readings.
    """

    law: ca.Function
    """(t, x, y), (sensor readings), (lowest and highest duties), memory, numbers -> duties, steering angles, next
    memory"""
    numbers: np.ndarray
    "constants of the law"
    memory: np.ndarray
    """memory of the law; each sample reads it and replaces it by the next memory"""

    @property
    def looks_at_limits(self) -> bool:
        """Whether the law takes the lowest and highest duties that a torque limit allows as an input."""
        return bool(self.law.size1_in(2))


@dataclass(frozen=True)
class CompiledController:
    """A controller in a form that the compiled loop can run: fixed commands or a control law, optionally with torque
    limits and sensor noise.

    The method `native(wheels)` of a controller of the package returns this form.
    """

    duty: Any = 0.0
    "fixed duty: one number, or one for each wheel"
    steer: Any = 0.0
    "fixed steering angle [rad]: one number, or one for each steered wheel"
    slip: SlipLaw | None = None
    """control law that computes the duty of each wheel from its slip; None: there is no such law"""
    limit: TorqueTable | None = None
    law: DriveLaw | None = None
    """control law that computes duties and steering angles of the whole rover; None: there is no such law"""
    onboard: OnboardLaw | None = None
    stop: StopLaw | None = None
    noise: SensorNoise | None = None

    def fields(self, kernel: Kernel, samples: int) -> dict[str, Any]:
        """Return the fields of the C struct Loop that describe this controller. `samples` is the number of control
        instants in the drive; sensor noise is drawn for each.
        """
        # Fixed commands come first; a law, limits and noise add their own fields.
        # `reads` counts the readings of a sample: roll, pitch and yaw, two for each wheel, and the suspension's angles.
        wheels, servos = len(kernel.duty), len(kernel.servo_wheels)
        reads = 3 + 2 * wheels + len(suspension_places(kernel.model.rover))
        steer = np.asarray(self.steer if servos else 0.0, dtype=float)
        fields: dict[str, Any] = {
            "duty_fixed": np.broadcast_to(np.asarray(self.duty, dtype=float), wheels).copy(),
            "steer_fixed": np.broadcast_to(steer, max(1, servos)).copy(),
            "read": np.zeros(reads),
        }
        if self.slip is not None:
            # A slip law runs in the kernel's work space, and the kernel keeps the law's library loaded.
            assert self.slip.law.sz_w() <= kernel.keep["work_w"].size
            kernel.keep["slip_law"], address = _compile_law(self.slip.law)
            fields |= {
                "slip_law": address,
                "gains": np.array(self.slip.gains, dtype=float),
                "integral": self.slip.integral,
                "depth": self.slip.depth,
                "control_period": self.slip.period,
            }
            if self.slip.table is not None:
                duty, speed = (np.array(column, dtype=float) for column in self.slip.table[:2])
                fields |= {"table_duty": duty, "table_speed": speed, "n_table": len(duty)}
                fields |= {"table_radius": self.slip.table.r}
        if self.limit is not None:
            fields |= {
                "limit_pitch": np.array(self.limit.pitches, dtype=float),
                "limit_torque": np.array(self.limit.torques, dtype=float).T.copy(),
                "n_pitches": len(self.limit.pitches),
                "stall_torque": self.limit.stall_torque,
                "no_load_rate": self.limit.no_load_rate,
            }
        if self.law is not None:
            # The law reads its memory, and writes the next memory into an array of its own.
            kernel.keep["drive_law"], address = _compile_law(self.law.law)
            sizes = {"law_next": len(self.law.memory), "law_limits": 2 * wheels, "law_w": self.law.law.sz_w()}
            fields |= {name: np.zeros(max(1, count)) for name, count in sizes.items()}
            fields |= {"law_numbers": self.law.numbers, "law_memory": self.law.memory}
            fields |= {"drive_law": address, "n_memory": len(self.law.memory)}
        if self.onboard:
            fields |= self.onboard._asdict()
        if self.stop:
            fields |= {f"stop_{name}": value for name, value in self.stop._asdict().items()}
        if self.noise is not None:
            # All noise of the drive is drawn here, in the order in which `NoisyController` would draw it.
            rows = self.noise.random.standard_normal((samples, reads))
            fields |= {"noise": rows, "noise_sds": self.noise.sds, "noise_steps": self.noise.steps}
        return fields


def commands_of(controller: Any, wheels: int, servos: int | None = None) -> CompiledController | None:
    """Return a controller in the form that the compiled loop can run, or None if the controller has to be called from
    Python.

    Python has to call it in three cases: it has no method `native`; a subclass has overridden `__call__`, which the
    compiled loop would ignore; or its commands are for another number of wheels or servos, which `obey` then reports as
    an error.
    """
    # The class that defines `native` must also be the one that defines `__call__`.
    kind = type(controller)
    home = next((base for base in kind.__mro__ if "native" in vars(base)), None)
    if home is None or home is not next(base for base in kind.__mro__ if "__call__" in vars(base)):
        return None
    commands = controller.native(wheels)
    assert isinstance(commands, (CompiledController, type(None)))
    widths = () if commands is None else ((commands.duty, wheels), (commands.steer, servos or None))
    fits = all(count is None or np.shape(values) in ((), (count,)) for values, count in widths)
    return commands if fits else None


@lru_cache(maxsize=4)
def _compile_law(law: ca.Function) -> tuple[ctypes.CDLL, int]:
    """Return the compiled library of a control law, and the address of the law's C function in it."""
    handle = shared_library(generated_source(law), "control")
    return handle, ctypes.cast(getattr(handle, law.name()), ctypes.c_void_p).value or 0
