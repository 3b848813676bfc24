"""What is hidden comes back by its own name and with its own number, in each kind of data, within seconds.

The data are made by code that shares nothing with the package, so that a name that belongs to another law, or a number
in another unit, is noticed before the frozen answers of whole loops are.
"""

import math

import numpy as np
import pandas as pd
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.discrepancy.experiment import Parts
from rover_pin.discrepancy.search import Search, calibrate
from rover_pin.discrepancy.signature import signatures
from rover_pin.estimation.fit import again
from rover_pin.estimation.random_effects.learnt_noise import with_learnt_noise
from rover_pin.experiments.drive_log.calibrate import experiment_on
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.experiments.slip_slope import SlipSlope
from rover_pin.experiments.traction_factors import TractionFactors
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.identify import identify
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.rover.proposal.new_rover import new_rover
from rover_pin.simulation.model.effect_files import known_effects
from tests.experiments.drive_log import drive_sets
from tests.oracle import brake_generator, pendulum_generator, slope_generator
from tests.oracle.terramechanics import panel_forces


def assert_found(verdict, number, true):
    """The number's owner is named, alone, and its interval holds the truth."""
    assert verdict.named == (number.partition(".")[0],), verdict.summary()
    (fitted_number,) = (fitted for fitted in verdict.after.numbers if fitted.name == number)
    assert fitted_number.low < true < fitted_number.high
    assert fitted_number.value == pytest.approx(true, rel=0.15)


@pytest.mark.parametrize(
    ("number", "hidden"), [("ViscousFriction.b_v", {"viscous": 0.02}), ("DeadBand.delta_0", {"dead": 0.06})]
)
def test_of_a_motor_on_a_brake(tmp_path, number, hidden):
    (true,) = hidden.values()
    assert_found(close_the_loop(brake_generator.write(tmp_path, 0, **hidden), experiment="motor_brake"), number, true)


@pytest.mark.parametrize(("law", "number"), [("Viscous", "b"), ("Play", "gap")])
def test_of_a_function_of_time(tmp_path, law, number):
    true = pendulum_generator.write(tmp_path, law, seed=1, length=0.8)[number]
    assert_found(close_the_loop(tmp_path, experiment="pendulum"), f"{law}.{number}", true)


SLOPE = """kind = "slip-slope"
name = "skid"
rover = "rover.toml"
[soil]
phi = { value = 31.5, unit = "deg", sd = 3.0 }
k = { value = 40, unit = "mm", sd = 20 }
k_1 = { value = 65, unit = "kPa", sd = 30 }
"""


def test_of_slip_against_slope(tmp_path):
    """Of the laws of sinkage and grip only the one that digs meets the table, and best with its exponent.

    The soil is the true one; a loop over this table finds the same in minutes (`tests/loop/test_slip_slope.py`).
    """
    (tmp_path / "rover.urdf").write_text(slope_generator.field_log.skid()[0])
    new_rover(tmp_path / "rover.urdf")
    (tmp_path / "slope.toml").write_text(SLOPE)
    slope_generator.write(tmp_path, sd=0.0, repeats=1, digs=0.8)
    bed = SlipSlope.read(tmp_path)
    base = bed.with_values(bed.base_model(), {"MotionResistance.R": 0.05})
    tried = {candidate.name: candidate for candidate in bed.candidates(base, known_effects(None))}

    def missed(name, values=()):
        model = bed.with_values(tried[name].on(base), dict(values))
        return float(np.sqrt(np.mean((bed.observed - bed.predict([model])[0]) ** 2)))

    exponents = (0.6, 0.8, 1.0)
    rms = [missed("SlipSinkage", {"SlipSinkage.n_1": n_1}.items()) for n_1 in exponents]
    assert min(rms) == rms[1] < 0.004
    assert min(missed(name) for name in ("SlipSoftening", "LoadExponent", "DiggingMemory")) > 3.0 * rms[1]
    assert tried["SlipSinkage"].amplitudes == ("SlipSinkage.n_1",)


def test_of_a_drive_log(tmp_path):
    """A tachogenerator that reads 12 % too fast and a level that is off by 0.02 rad, put into the files of a drive."""
    folder = drive_sets.write(tmp_path, runs=2, duration=5.0)
    for file in sorted(folder.glob("run-*.csv")):
        table = pd.read_csv(file)
        table["wheel_rate_mr"] *= 1.12
        table["body_pitch"] += 0.02
        table.to_csv(file, index=False)
    log = read_drive_log(folder)
    experiment, model, numbers = experiment_on(log, with_spread(base_model(log), motors=True))
    base = calibrate(experiment, model, numbers)
    tried = [
        candidate for candidate in candidates(model, experiment, numbers, known_effects(None))
        if candidate.kind in ("TachoScale", "SensorBias")
        and not candidate.place.startswith(("current", "rocker", "bogie"))
    ]  # fmt: skip
    rows = signatures(base, tried)
    search = Search(again(with_learnt_noise(base, [row.shift for row in rows]), stale=True))
    search.run(rows)
    best = search.beliefs().best()
    assert set(best.names) == {"TachoScale[mr]", "SensorBias[body_pitch]"}
    by_name = {parameter.name: parameter for parameter in best.parameters}
    for number, true in (("TachoScale[mr].e", 0.12), ("SensorBias[body_pitch].bias", 0.02)):
        mean, sd = best.moments(number)
        values_in_prior = [by_name[number].value(mean + step * sd) for step in (-3.0, 0.0, 3.0)]
        assert values_in_prior[0] < true < values_in_prior[2]
        assert values_in_prior[1] == pytest.approx(true, rel=0.4), "what a motor's own gain takes is not the sensor's"


def test_of_traction_factors():
    """Eqs (2) to (7) by plain quadrature: the soil's k and its angle of friction come back from another soil."""
    slips, r, b = np.linspace(0.02, 0.9, 12), 0.045, 0.05
    true = {"phi": math.radians(33.0), "k": 0.012}
    ends = {"theta_1": math.radians(35.0), "theta_2": math.radians(-5.0)}
    factor = []
    for S in slips:
        f_n, f_t, _ = panel_forces(S, *ends.values(), r, b, 0.005, true["phi"], true["k"], 5e4, 1.0)
        factor.append(float(f_t / f_n))
    points = TractionPoints(slips, np.array(factor), 0.004)
    constants = {"r": r, "b": b, "c": 0.005, "n": 1.0, "k_1": 5e4, **ends}
    identification = identify(TractionFactors(points, Parts({"soil": Soil(), "wheel": Wheel()})), fixed=constants)
    assert identification.found == ("soil.phi", "soil.k")
    for name, value in true.items():
        assert identification[name].number.value == pytest.approx(value, rel=0.01)
