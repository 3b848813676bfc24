"""P(stuck) and P(buried) within seconds and their most likely cause, from what the rover feels on board."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.monitor.source import RATES, AheadLaw, MonitorStruct, lengths, library
from rover_pin.control.sensing.onboard_slip import SLIPS, OnboardSlip
from rover_pin.control.torque_factor import pull_factors, standing_sinkage
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.native.shared import fill

CAUSES = ("grip lost", "digging", "wall", "motor", "sensor")
CANNOT_TELL = "cannot tell"


class Forecast(NamedTuple):
    """What the monitor says at a sample, of the next `HORIZON` seconds under the present command."""

    t: float
    "time of the sample [s]"
    p_stuck: float
    "probability that the rover then stands while its rims turn: S above 0.9 [-]"
    p_buried: float
    "probability that a wheel has sunk by `Model.buried` radii by then [-]"
    alarm: bool
    "whether the smoothed P(stuck) has reached `ALARM`, and has not fallen to half of it since"
    cause: str
    "most likely cause: one of `CAUSES`, 'cannot tell', or '' where P(stuck) is below `WORTH` and nothing is at fault"
    causes: tuple[float, ...]
    "probability of each of `CAUSES` [-]; the first three sum to P(stuck) where that is `WORTH` or more"


class Monitor:
    """The monitor of a rover: `step` is called once a control period.

    The on-board belief's particles are drawn with a rate of digging each, and go on for `HORIZON` under the present rim
    speeds by the balance of forces (`AheadLaw`): P(stuck) is the share of them that come to stand. What pushes back now
    beyond slope and hole is an obstacle, passed within a radius of way. The causes are what would let go: P without an
    obstacle is less by that of a wall, P without holes besides by that of digging; what remains is grip lost.

    Source: none. What it cannot see: an obstacle that no wheel touches yet. It knows the model's soil as `OnboardSlip`
    does, and is as wrong where that is wrong. Backwards, torques tell nothing, and P(stuck) is that the rover stands.
    For the first half second, in which the belief has felt nothing, P is 0. All of it is C (`monitor.c`).

    Faults, from the last samples: a motor that is well has i R = delta V - K omega, and a fault leaves anything up to
    the stall current in it; a reading that is not finite, or has not changed by its last bit while its motor is driven,
    is no reading. How fast the ground digs: hypotheses of c_d, each with its own holes, weighed by the forces, as pull
    less slope and holes is nothing, to within what uneven ground adds. What each second tells of them serves P(stuck),
    what the way alone tells P(buried): where the rover stands, an obstacle may hold it as well as a hole.

    Parameters
    ----------
    estimate : OnboardSlip
        Whose belief is read.
    law : AheadLaw
        The rover's numbers.
    pulls : array
        f_t / f_n over `SLIPS`.
    sinkage : float
        Of a wheel that stands on fresh ground [m].
    buried : float
        Sinkage over radius from which a wheel counts as buried.
    motor : Motor
        Of each wheel.
    """

    def __init__(
        self, estimate: OnboardSlip, law: AheadLaw, pulls: np.ndarray, sinkage: float, buried: float, motor: Motor
    ):
        self.estimate, self.law, self._settings = estimate, law, (law, pulls, sinkage, buried, motor)
        self._library, self.struct = library(law), MonitorStruct()
        self.keep: dict[str, Any] = {}
        n = len(law.radii)
        room = {name: np.zeros(size, dtype=np.int64 if name == "rate" else float) for name, size in lengths(n).items()}
        tables = {"radius": np.array(law.radii), "pulls": pulls, "pull_slopes": np.gradient(pulls, SLIPS)}
        numbers = {"n": n, "period": estimate.period, "sinkage": sinkage, "buried": buried}
        numbers["no_load_rate"] = float(motor.no_load_rate)
        numbers["stall_current"] = float(motor.supply / motor.resistance)
        fill(self.struct, self.keep, room | tables | numbers)
        self._address = ctypes.addressof(self.struct)
        self.reset()

    @classmethod
    def of(cls, model: Model, estimate: OnboardSlip | None = None) -> Monitor:
        """Return the monitor of a model's rover, motor, gravity and contact law, by this estimate or a new one."""
        relaxed = model.slip if isinstance(model.slip, RelaxedSlip) else RelaxedSlip()
        law = AheadLaw(tuple(model.built.radii.tolist()), relaxed, float(model.built.gravity))
        pulls, buried = pull_factors(model, SLIPS), float(model.buried)
        return cls(estimate or OnboardSlip.of(model), law, pulls, standing_sinkage(model), buried, model.motor)

    def reading_from(self, estimate: OnboardSlip) -> Monitor:
        """Return the same monitor by another estimate."""
        return Monitor(estimate, *self._settings)

    def reset(self) -> None:
        """Forget the past."""
        self.estimate.reset()
        self._library.rover_pin_monitor_reset(self._address)

    def step(self, reading: Reading) -> Forecast:
        """Return what is ahead; a reading that is not finite changes nothing but the cause, the truth is not read."""
        if self._check(reading):
            self.estimate.slip(reading)
            self._foresee()
        return self._forecast(reading.t)

    def after(self, reading: Reading) -> Forecast:
        """Return the same where a control has given the estimate this reading already."""
        if self._check(reading):
            self._foresee()
        return self._forecast(reading.t)

    @property
    def digging(self) -> np.ndarray:
        """Probability of each of `RATES`, by what the way tells."""
        weights = np.zeros(len(RATES))
        self._library.rover_pin_monitor_rates(self._address, weights.ctypes.data)
        return weights

    def _check(self, reading: Reading) -> bool:
        of_wheels = (reading.duty, reading.wheel_rate, reading.current)
        rows = [np.array(np.broadcast_to(row, len(self.law.radii)), dtype=float) for row in of_wheels]
        posture = np.array([*reading.attitude[:2], *reading.suspension])
        addresses = [row.ctypes.data for row in (*rows, posture)]
        return bool(self._library.rover_pin_monitor_check(self._address, *addresses, len(posture)))

    def _foresee(self) -> None:
        self._library.rover_pin_monitor_foresee(self._address, ctypes.addressof(self.estimate.belief.struct))

    def _forecast(self, t: float) -> Forecast:
        at, cause = self.struct, self._library.rover_pin_monitor_cause(self._address)
        name = "" if cause < 0 else (*CAUSES, CANNOT_TELL)[cause]
        causes = (*self.keep["causes"].tolist(), at.motor, at.sensor)
        return Forecast(t, at.p_stuck, at.p_buried, bool(at.alarm), name, causes)
