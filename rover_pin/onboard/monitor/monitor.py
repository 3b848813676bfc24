"""The monitor of a rover: it forecasts from on-board sensors the probabilities that the rover is stuck or buried within
seconds, P(stuck) and P(buried), and names the most likely cause.

`monitor.c` is the calculation, and `source.py` contains its equations, its constants and its struct.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.sensing.onboard_slip import SLIPS, OnboardSlip
from rover_pin.control.torque_factor import pull_factors, standing_sinkage
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.onboard.monitor.source import RATES, AheadLaw, MonitorStruct, lengths, library
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.native.shared import fill

CAUSES = ("grip lost", "digging", "wall", "motor", "sensor")
"""The causes that the monitor distinguishes: three causes of a stuck rover, and two faults (motor, sensor). The C code
numbers them in this order."""
CANNOT_TELL = "cannot tell"
"""Text that the monitor states as the cause if the rover will probably be stuck, but no single cause has more than half
of this probability."""


class Forecast(NamedTuple):
    """The forecast of the monitor at one sample for the next `HORIZON` seconds, if the present duties are kept."""

    t: float
    "time of the sample [s]"
    p_stuck: float
    """probability that after `HORIZON` the rover does not move while its rims turn, i.e. that its slip S is above 0.9
    [-]"""
    p_buried: float
    """probability that after `HORIZON` a wheel has sunk by more than `Model.buried` times its radius [-]"""
    alarm: bool
    """True from the time at which the smoothed P(stuck) reaches `ALARM` until it falls below half of `ALARM`"""
    cause: str
    "most likely cause: one of `CAUSES`, 'cannot tell', or '' if P(stuck) is below `WORTH` and nothing is faulty"
    causes: tuple[float, ...]
    """probability of each of the five `CAUSES` [-]; the first three sum to P(stuck) if P(stuck) is `WORTH` or more"""


class Monitor:
    """The monitor of a rover, which forecasts the probabilities P(stuck) and P(buried) that the rover is stuck or that
    a wheel is buried. Call `step` once in each control period.

    Forecast. The monitor reads the belief of the on-board slip estimate, a set of weighted particles. `DRAWS`
    particles, each with a random rate of digging, are continued for `HORIZON` seconds at the present rim speeds by the
    balance of forces (`AheadLaw`). P(stuck) is the fraction of these particles with a rover that stops. A resistance
    that is explained neither by the slope nor by the holes counts as an obstacle, which the rover passes within one
    wheel radius.

    Causes. The forecast is repeated without the obstacle, and then without obstacle and holes. The first reduction of
    P(stuck) is the probability of a wall, the second reduction is the probability of digging, and the remainder is the
    probability of lost grip.

    Faults. The latest `WINDOW` samples are searched for faults. A sound motor obeys i R = delta V - K omega, with the
    current i, the resistance R, the duty delta, the supply voltage V, the torque constant K and the wheel rate omega. A
    faulty motor may have any difference between the two sides of this equation, up to the stall current. A reading is a
    sensor's fault if it is not finite, or if it has not changed at all although its motor is driven.

    Rate of digging. The hypotheses are values of c_d, the rate of digging of `DiggingMemory`; for each hypothesis, the
    monitor integrates separate depths of the holes. Each hypothesis is weighed by the balance of forces: the pull of
    the wheels minus the resistance of slope and holes must be zero to within the scatter that uneven ground adds.
    P(stuck) uses the evidence of the whole time. P(buried) uses only the evidence of the driven distance, because an
    obstacle, like a hole, can hold a rover that does not move.

    Limits. The monitor cannot see an obstacle that no wheel touches yet. It assumes the soil of the model, as
    `OnboardSlip` does, and its forecast is wrong if this soil is wrong. In reverse, torques carry no information, and
    P(stuck) is the probability that the rover does not move now. In the first half second, both probabilities are 0.

    Source: none.

    Parameters
    ----------
    estimate : OnboardSlip
        Slip estimate whose belief the monitor reads.
    law : AheadLaw
        Constants of the rover in the balance of forces.
    pulls : array
        Pull factors f_t / f_n at the slips `SLIPS` [-].
    sinkage : float
        Sinkage of a wheel on fresh ground without slip [m].
    buried : float
        Maximum ratio of sinkage to radius of a wheel that is not buried [-].
    motor : Motor
        Motor of each wheel.

    Examples
    --------
    >>> from rover_pin import scenario, simulate
    >>> model = scenario("flat").model
    >>> monitor, forecasts = Monitor.of(model), []
    >>> def control(reading):
    ...     forecasts.append(monitor.step(reading))
    ...     return 0.5
    >>> trace = simulate(model, control, 1.0)
    >>> all(0.0 <= forecast.p_stuck <= 1.0 for forecast in forecasts)
    True
    """

    def __init__(
        self, estimate: OnboardSlip, law: AheadLaw, pulls: np.ndarray, sinkage: float, buried: float, motor: Motor
    ):
        self.estimate, self.law, self._settings = estimate, law, (law, pulls, sinkage, buried, motor)
        self._library, self.struct = library(law), MonitorStruct()
        self.keep: dict[str, Any] = {}
        # The struct points to these arrays and tables, so `keep` holds them as long as the monitor lives.
        n = len(law.radii)
        arrays = {
            name: np.zeros(size, dtype=np.int64 if name == "rate" else float) for name, size in lengths(n).items()
        }
        tables = {"radius": np.array(law.radii), "pulls": pulls, "pull_slopes": np.gradient(pulls, SLIPS)}
        numbers = {"n": n, "period": estimate.period, "sinkage": sinkage, "buried": buried}
        numbers["no_load_rate"] = float(motor.no_load_rate)
        numbers["stall_current"] = float(motor.supply / motor.resistance)
        fill(self.struct, self.keep, arrays | tables | numbers)
        self._address = ctypes.addressof(self.struct)
        self.reset()

    @classmethod
    def of(cls, model: Model, estimate: OnboardSlip | None = None) -> Monitor:
        """Return the monitor for a model's rover, soil and motor.

        The monitor reads the particles of the slip estimate `estimate`. If `estimate` is None, the monitor makes its
        own slip estimate.
        """
        relaxed = model.slip if isinstance(model.slip, RelaxedSlip) else RelaxedSlip()
        law = AheadLaw(tuple(model.built.radii.tolist()), relaxed, float(model.built.gravity))
        pulls, buried = pull_factors(model, SLIPS), float(model.buried)
        return cls(estimate or OnboardSlip.of(model), law, pulls, standing_sinkage(model), buried, model.motor)

    def reading_from(self, estimate: OnboardSlip) -> Monitor:
        """Return a monitor with these constants that reads the particles of another slip estimate."""
        return Monitor(estimate, *self._settings)

    def reset(self) -> None:
        """Reset the monitor and its slip estimate to the start of a drive."""
        self.estimate.reset()
        self._library.rover_pin_monitor_reset(self._address)

    def step(self, reading: Reading) -> Forecast:
        """Update the slip estimate with a reading of the sensors, and return the forecast after this reading.

        If a control already gives its readings to the slip estimate, use `after` instead. The true slips in the reading
        are not used. If the reading is not finite, only the cause changes.
        """
        if self._check(reading):
            self.estimate.slip(reading)
            self._foresee()
        return self._forecast(reading.t)

    def after(self, reading: Reading) -> Forecast:
        """Return the forecast after a reading of the sensors. A control has already updated the slip estimate with this
        reading.
        """
        if self._check(reading):
            self._foresee()
        return self._forecast(reading.t)

    @property
    def digging(self) -> np.ndarray:
        """Probability of each rate of digging in `RATES` [-], given the evidence of the driven distance."""
        weights = np.zeros(len(RATES))
        self._library.rover_pin_monitor_rates(self._address, weights.ctypes.data)
        return weights

    def _check(self, reading: Reading) -> bool:
        """Search for faults of motors and sensors. Return whether the reading is finite, so that the forecast can use
        it.
        """
        # A duty may be one number for all wheels; C reads plain arrays of doubles.
        of_wheels = (reading.duty, reading.wheel_rate, reading.current)
        rows = [np.array(np.broadcast_to(row, len(self.law.radii)), dtype=float) for row in of_wheels]
        posture = np.array([*reading.attitude[:2], *reading.suspension])
        addresses = [row.ctypes.data for row in (*rows, posture)]
        return bool(self._library.rover_pin_monitor_check(self._address, *addresses, len(posture)))

    def _foresee(self) -> None:
        """Update the probabilities of the rates of digging, and the forecast, from the present particles of the slip
        estimate.
        """
        self._library.rover_pin_monitor_foresee(self._address, ctypes.addressof(self.estimate.belief.struct))

    def _forecast(self, t: float) -> Forecast:
        """Return the forecast at the time t [s] from the present values of the C struct."""
        # C numbers the causes from 0, and uses -1 for no cause.
        struct, cause = self.struct, self._library.rover_pin_monitor_cause(self._address)
        name = "" if cause < 0 else (*CAUSES, CANNOT_TELL)[cause]
        causes = (*self.keep["causes"].tolist(), struct.motor, struct.sensor)
        return Forecast(t, struct.p_stuck, struct.p_buried, bool(struct.alarm), name, causes)
