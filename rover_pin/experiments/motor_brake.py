"""An experiment with a motor on a brake: duty and braking torque are set, and steady wheel rate and current are
measured.

Copy this file for an experiment of your own, which runs by `rover-pin close-loop DATA --experiment FILE`. Here DATA is
a folder with two files: motor.toml declares the motor in the form of a drive log, and points.csv holds the steady
points. The column `run` of points.csv names the fold of each point. Each fold is held out of a fit once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import casadi as ca
import numpy as np

from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import record_from
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.experiment import FileExperiment, Parts
from rover_pin.effects.effect import MotorEffect
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import read_folded
from rover_pin.simulation.compiled.laws import motor_law, numbers
from rover_pin.simulation.model.motor import Motor

COLUMNS = ("duty", "load_Nm", "wheel_rate_radps", "current_A", "wheel_rate_sd_radps", "current_sd_A")


@dataclass(frozen=True, eq=False)
class MotorBrake(FileExperiment):
    """Steady points of a motor on a brake, as an experiment for the fit of a motor model.

    `inputs` are the duty and the braking torque that were set (folds, 2, samples), `observed` are the measured wheel
    rate and current (equal shape), and `sd` holds the SDs of wheel rate and current (2,).
    """

    motor: Motor
    folds: tuple[str, ...]
    inputs: np.ndarray
    observed: np.ndarray
    sd: np.ndarray
    name, channels, stand_in = "motor on a brake", ("wheel rate", "current"), 1e3

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the experiment from a folder with motor.toml and points.csv."""
        # Columns of points.csv: two inputs, two measured channels, and their SDs.
        folds, points = read_folded(path / "points.csv", "run", COLUMNS)
        motor = record_from(Motor, table_in(read_toml(path / "motor.toml"), "motor", "motor.toml"), "motor.toml")
        return cls(motor, folds, points[:, :2], points[:, 2:4], np.sqrt(np.nanmean(points[:, 4:] ** 2, axis=(0, 2))))

    def base_model(self) -> Parts:
        """Return the declared motor without any effect. The search for missing effects may add some to this model."""
        return Parts({"motor": self.motor})

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return gear ratio and resistance as uncertain parameters. Data sheets state both to about 4 % (assumed)."""
        return tuple(self.parameter(model, f"motor.{n}", 0.04, True, "motor.toml") for n in ("gear", "resistance"))

    @property
    def varied(self) -> np.ndarray:
        """Inputs of each sample (folds, samples, 2): the duty and the braking torque that were set."""
        return np.swapaxes(self.inputs, 1, 2)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return "rad/s" if channel == "wheel rate" else "A"

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the motor effects without states as candidates for a missing effect. Effects with states do not show
        in steady points.
        """
        # A neutral value is needed, because a missing effect is compared with the model in which it does nothing.
        steady = [kind for kind in kinds if issubclass(kind, MotorEffect) and kind.neutral and not kind.states]
        return tuple(plain_candidate(kind()) for kind in steady)

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the steady wheel rate and current of each model (models, folds, 2, samples), at which motor torque and
        braking torque are equal.
        """
        return np.array([self._steady(model.records["motor"], model.effects) for model in models])

    def _steady(self, motor: Motor, effects: tuple[MotorEffect, ...]) -> np.ndarray:
        """Return the steady wheel rate and current of one motor (folds, 2, samples). The wheel rate is found by
        Newton's method.
        """
        # All points are solved at once, one column each. The law returns torque, its slope over the rate, and current.
        law, values = motor_law(motor, effects), numbers([motor, *effects])
        duty, load = np.nan_to_num(self.inputs).transpose(1, 0, 2).reshape(2, -1)
        rate, none = np.zeros(duty.size), np.zeros(duty.size)
        for _ in range(30):
            out = np.array(law(np.array([duty, rate, none, none]), ca.DM(0, duty.size), values))
            # The torque of a motor falls with the rate. A slope that is kept negative cannot send a step the wrong way.
            rate = rate - (out[0] - load) / np.minimum(out[1], -1e-9)
        steady = np.array([rate, out[2]]).reshape(2, *self.inputs.shape[::2])
        return np.nan_to_num(steady.transpose(1, 0, 2), nan=self.stand_in)
