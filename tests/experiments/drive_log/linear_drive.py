"""A drive log whose features are exactly linear in a model's numbers: fits answer in milliseconds, in closed form.

The rover, its effects and the candidates are the package's own; only the experiment that would replay runs is a stub.
"""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit, Task, fit
from rover_pin.estimation.noise import Noise
from rover_pin.experiments.drive_log.model import DRIVEN_SAND, owner_name, owners, parameter, with_record
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import nexus6_motor
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.wheel_forces import TorqueTraction
from rover_pin.terrain.shapes import flat

RUNS, CHANNELS, BLOCKS = 4, ("path", "current_fl_A"), 16
SHAPE = (RUNS, len(CHANNELS), BLOCKS)
PERIOD, ROWS_A_BLOCK = 0.05, 10


@dataclass(frozen=True)
class LinearExperiment(Experiment):
    """features = sum over numbers (value - zero) slope; a number of an effect that the model lacks counts nothing."""

    is_timed, held = True, False
    observed: np.ndarray
    slopes: dict[str, tuple[float, np.ndarray]]
    "zero and slope (runs, channels, blocks) by name of the number"
    runs: tuple = ()
    channels: tuple[str, ...] = CHANNELS
    folds: tuple[str, ...] = tuple(f"run-{run}" for run in range(RUNS))
    length: int = BLOCKS
    rate_driven: bool = False
    asked: list = field(default_factory=list)

    def predict(self, models):
        self.asked.append(len(models))
        return np.array([self._features(owners(model)) for model in models])

    def records(self, model):
        return owners(model)

    def replace_record(self, model, owner, record):
        return with_record(model, owner, record)

    def unit(self, channel):
        return "m" if channel == "path" else "A"

    @property
    def free(self):
        return self

    def replays(self, model, nudges=None):
        """Return replays that stray 10 mm from the log, and 1 mm less for each effect that was added."""
        off = 0.01 - 0.001 * (len(model.all_effects) - len(MODEL.all_effects))
        channels = [{"body_x": run.commands.place[:, 0] + off, "body_y": 0.0 * run.commands.t} for run in self.runs]
        return tuple(SimpleNamespace(model=model, channels=channel) for channel in channels)

    def read(self, replays, sensors):
        return self._features(owners(replays[0].model) | {owner_name(sensor): sensor for sensor in sensors})

    def _features(self, records):
        total = np.zeros(self.observed.shape)
        for name, (zero, slope) in self.slopes.items():
            owner, _, quantity = name.rpartition(".")
            if owner in records:
                total += (float(getattr(records[owner], quantity)) - zero) * slope
        return total


def on_flat(soil=DRIVEN_SAND):
    """Nexus 6 on level ground, its wheels' angles fixed."""
    rover = load_rover("nexus6")
    effects = base_effects(soil, rover, SoilTraction(TorqueTraction(), FixedAngles()))
    return Model(rover, flat(), (soil,), nexus6_motor(), effects=effects)


MODEL = on_flat().having(WeakMotor(g=0.0, wheel=0))


def runs_of(shape):
    """Runs as far as reports and descriptions look at them: times, duty and place."""
    runs_made = []
    for run in range(shape[0]):
        t = PERIOD * np.arange(ROWS_A_BLOCK * shape[2])
        duty = np.tile(np.random.default_rng(run).uniform(0.2, 0.9, shape[2]).repeat(ROWS_A_BLOCK)[:, None], (1, 6))
        place = np.column_stack([0.03 * t, 0.0 * t, 0.0 * t])
        commands = SimpleNamespace(t=t, duty=duty, place=place, period=PERIOD, terrain=None)
        times = t.reshape(-1, ROWS_A_BLOCK).mean(axis=1)
        runs_made.append(
            SimpleNamespace(name=f"run-{run}", commands=commands, times=times, measured={}, channels=CHANNELS)
        )
    return tuple(runs_made)


def white(shape=SHAPE, sd=1.0):
    """Noise of one SD, without memory or common mode, everywhere compared."""
    return Noise(np.full(shape[1], sd), np.zeros(shape[1]), np.eye(shape[1]), np.ones(shape, dtype=bool))


def nuisances(model=MODEL):
    """Two numbers that are uncertain without anything missing, u standard normal."""
    return (parameter(model, "soil.phi", 0.03), parameter(model, "WeakMotor[0].g", 0.02))


def slopes(random, names, shape=SHAPE, size=1.0):
    """Random slopes that move the features by about `size` SDs for one u of the parameters."""
    return {name.name: (name.origin, size * random.normal(size=shape) / name.scale) for name in names}


def fitted(truth, columns, free=None, model=MODEL, noise=None) -> Fit:
    """The package's own fit of the free numbers to what was seen, on the linear experiment."""
    free = nuisances() if free is None else free
    experiment = LinearExperiment(truth, columns, runs_of(truth.shape))
    return fit(Task(experiment, noise or white(truth.shape)), model, free)


# --- the closed form -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Gaussian:
    """y = X u + noise of SD 1, u_j normal about m_j with SD s_j, or anything where s_j is infinite."""

    X: np.ndarray
    y: np.ndarray
    mean: np.ndarray
    sd: np.ndarray

    def solved(self, keep=slice(None)):
        """Return u of least squares on some rows, and chi2 with the priors."""
        is_finite = np.isfinite(self.sd)
        rows = np.diag(1 / self.sd)[is_finite]
        matrix = np.vstack([self.X[keep], rows])
        right = np.concatenate([self.y[keep], self.mean[is_finite] / self.sd[is_finite]])
        u = np.linalg.solve(matrix.T @ matrix, matrix.T @ right)
        residual = right - matrix @ u
        return u, float(residual @ residual)

    @property
    def covariance(self):
        is_finite = np.isfinite(self.sd)
        rows = np.diag(1 / self.sd)[is_finite]
        return np.linalg.inv(self.X.T @ self.X + rows.T @ rows)

    def left_out(self, owner):
        """Return the sum of squares of every group of rows, as least squares on the others predict it."""
        losses = []
        for run in np.unique(owner):
            u, _ = self.solved(owner != run)
            residual = self.y[owner == run] - self.X[owner == run] @ u
            losses.append(float(residual @ residual))
        return np.array(losses)


def gaussian(fitted_):
    """The closed form of a linear fit: X from the experiment's own slopes."""
    experiment = fitted_.task.experiment
    columns, sd = [], []
    for number in fitted_.parameters:
        assert not number.log
        columns.append((number.scale * experiment.slopes[number.name][1]).ravel())
        sd.append(1.0 if number.prior else np.inf)
    zero = sum(
        (number.origin - experiment.slopes[number.name][0]) * experiment.slopes[number.name][1]
        for number in fitted_.parameters
    )
    return Gaussian(np.array(columns).T, (experiment.observed - zero).ravel(), np.zeros(len(sd)), np.array(sd))


def owner_of_rows(shape=SHAPE):
    return np.broadcast_to(np.arange(shape[0])[:, None, None], shape).ravel()
