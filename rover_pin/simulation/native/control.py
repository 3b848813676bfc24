"""A built-in controller as the compiled loop takes it: numbers, so that Python is not asked at every sample."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.suspension import suspension_places
from rover_pin.simulation.compiled.toolchain import shared_library


class SlipTable(NamedTuple):
    """Eq (9)'s table, and the wheel's radius [m]."""

    duty: Sequence[float]
    speed: Sequence[float]
    r: float


class TorqueTable(NamedTuple):
    """Greatest torques [N m] by pitch [rad] and wheel, and the motor that gives them."""

    pitches: np.ndarray
    torques: Sequence[Sequence[float]]
    stall_torque: float
    no_load_rate: float


class SlipLaw(NamedTuple):
    """A law of one wheel, (S_hat, integral, highest duty, rate, travel, hole), gains -> duty, memories' rates.

    Both memories, `integral` and the hole's `depth`, are read and written.
    """

    law: ca.Function
    gains: Sequence[float]
    integral: np.ndarray
    depth: np.ndarray
    period: float
    table: SlipTable | None
    "None: the true slip"


class OnboardLaw(NamedTuple):
    """An estimate of the slips by what the rover feels, in C: `sense` of `belief`, which keep them alive."""

    sense: int
    "the address of the function (belief, sample, whether it drives backwards, late speed)"
    belief: int
    sample: np.ndarray
    "roll and pitch, suspension, rates, currents"
    slips_and_holes: np.ndarray
    "slip, its SD, hole, its SD of each wheel"
    p_stands: int
    "the address of the probability that the rover stands"
    backwards: float
    rim_radius: float
    "that of the hole law [m]; 0 where there is none"


class StopLaw(NamedTuple):
    """When a control with an `OnboardLaw` stops for good, as `stops` in tables.c; `memory` is read and written."""

    p: float
    "from which a rover counts as standing"
    law: np.ndarray
    "weight of a sample, share of late samples, depth of the deepest hole over r"
    memory: np.ndarray
    "late share, and above 0: it has stopped"


class Noise(NamedTuple):
    """What sensors add: SDs and steps of attitude, rates, currents and angles, and the generator of their noise."""

    sds: np.ndarray
    steps: np.ndarray
    random: np.random.Generator


class DriveLaw(NamedTuple):
    """A law of the whole rover: (t, x, y), (what is read), (limits), memory, numbers -> duties, steering, memory.

    The memory is read and written.
    """

    law: ca.Function
    numbers: np.ndarray
    memory: np.ndarray

    @property
    def looks_at_limits(self) -> bool:
        """Whether it reckons with the lowest and highest duties that a torque limit allows."""
        return bool(self.law.size1_in(2))


@dataclass(frozen=True)
class Commands:
    """Fixed duties and steering, a slip law's duties, or a law's of both, under a torque limit, by noisy sensors."""

    duty: Any = 0.0
    steer: Any = 0.0
    slip: SlipLaw | None = None
    limit: TorqueTable | None = None
    law: DriveLaw | None = None
    onboard: OnboardLaw | None = None
    stop: StopLaw | None = None
    noise: Noise | None = None

    def fields(self, kernel: Kernel, samples: int) -> dict[str, Any]:
        """Return the fields of the struct Loop that say so, for this number of samples."""
        wheels, servos = len(kernel.duty), len(kernel.servo_wheels)
        reads = 3 + 2 * wheels + len(suspension_places(kernel.model.rover))
        steer = np.asarray(self.steer if servos else 0.0, dtype=float)
        fixed: dict[str, Any] = {
            "duty_fixed": np.broadcast_to(np.asarray(self.duty, dtype=float), wheels).copy(),
            "steer_fixed": np.broadcast_to(steer, max(1, servos)).copy(),
            "read": np.zeros(reads),
        }
        return {
            **fixed,
            **_slip_fields(self.slip, kernel),
            **_limit_fields(self.limit),
            **_law_fields(self.law, kernel),
            **(self.onboard._asdict() if self.onboard else {}),
            **({f"stop_{name}": value for name, value in self.stop._asdict().items()} if self.stop else {}),
            **_noise_fields(self.noise, samples, reads),
        }


class Controller(Protocol):
    """A controller that can be sampled in the compiled loop."""

    def native(self, wheels: int) -> Commands | None:
        """Return what the loop needs of it, or None where it must be asked."""


def commands_of(controller: Any, wheels: int, servos: int | None = None) -> Commands | None:
    """Return a built-in controller for the loop; None for any other, and for one whose `__call__` is not its own.

    One of another rover, with other wheels or servos (where their number is given), is asked: that refuses it.
    """
    kind = type(controller)
    home = next((base for base in kind.__mro__ if "native" in vars(base)), None)
    if home is None or home is not next(base for base in kind.__mro__ if "__call__" in vars(base)):
        return None
    commands = controller.native(wheels)
    assert isinstance(commands, (Commands, type(None)))
    widths = () if commands is None else ((commands.duty, wheels), (commands.steer, servos or None))
    fits = all(count is None or np.shape(values) in ((), (count,)) for values, count in widths)
    return commands if fits else None


def _slip_fields(slip: SlipLaw | None, kernel: Kernel) -> dict[str, Any]:
    if slip is None:
        return {}
    assert slip.law.sz_w() <= kernel.keep["work_w"].size
    handle, address = _compile_law(slip.law)
    kernel.keep["slip_law"] = handle
    fields = {
        "slip_law": address,
        "gains": np.array(slip.gains, dtype=float),
        "integral": slip.integral,
        "depth": slip.depth,
        "control_period": slip.period,
    }
    if slip.table is not None:
        duty, speed = (np.array(column, dtype=float) for column in slip.table[:2])
        fields |= {"table_duty": duty, "table_speed": speed, "n_table": len(duty), "table_radius": slip.table.r}
    return fields


def _limit_fields(limit: TorqueTable | None) -> dict[str, Any]:
    if limit is None:
        return {}
    return {
        "limit_pitch": np.array(limit.pitches, dtype=float),
        "limit_torque": np.array(limit.torques, dtype=float).T.copy(),
        "n_pitches": len(limit.pitches),
        "stall_torque": limit.stall_torque,
        "no_load_rate": limit.no_load_rate,
    }


def _law_fields(drive: DriveLaw | None, kernel: Kernel) -> dict[str, Any]:
    if drive is None:
        return {}
    kernel.keep["drive_law"], address = _compile_law(drive.law)
    room = {"law_next": len(drive.memory), "law_limits": 2 * len(kernel.duty), "law_w": drive.law.sz_w()}
    fields = {name: np.zeros(max(1, count)) for name, count in room.items()}
    fields |= {"law_numbers": drive.numbers, "law_memory": drive.memory}
    return {**fields, "drive_law": address, "n_memory": len(drive.memory)}


def _noise_fields(noise: Noise | None, samples: int, reads: int) -> dict[str, Any]:
    if noise is None:
        return {}
    rows = noise.random.standard_normal((samples, reads))
    return {"noise": rows, "noise_sds": noise.sds, "noise_steps": noise.steps}


@lru_cache(maxsize=4)
def _compile_law(law: ca.Function) -> tuple[ctypes.CDLL, int]:
    handle = shared_library(generated_source(law), "control")
    return handle, ctypes.cast(getattr(handle, law.name()), ctypes.c_void_p).value or 0
