"""A torque by motor current is a channel of its own, whose scale and zero are uncertain and those of a cell are not."""

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.experiments.wheel_rig.candidates import numbers_of
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.channel import MotorTorque
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import calibrated
from tests.oracle import rig_generator as hidden

CONSTANT, EFFICIENCY, NO_LOAD = 2.0, 0.75, 0.12
"""Torque at the axle for each ampere [N m/A] as the maker states it, the part of it that arrives, and the current [A]
of the unloaded drive."""


def by_current(folder, constant='{ value = 2.0, unit = "N m/A" }', cell=True):
    """A generated set whose motor draws the current of its torque, of an inefficient gear and of no load."""
    rig = hidden.Rig("none")
    path = hidden.write(folder, rig, hidden.rig_set(rig, loads=(25.0,)))
    lines = (path / "points.csv").read_text().splitlines()
    names = lines[0].split(",")
    at = names.index("torque_Nm")
    rows = [line.split(",") for line in lines[1:]]
    current = [float(row[at]) / (CONSTANT * EFFICIENCY) + NO_LOAD for row in rows]
    kept = [i for i in range(len(names)) if cell or i != at]
    table = [[names[i] for i in kept] + ["motor_current_A"]]
    table += [[row[i] for i in kept] + [f"{amperes:.6g}"] for row, amperes in zip(rows, current, strict=True)]
    (path / "points.csv").write_text("\n".join(",".join(row) for row in table) + "\n")
    toml = (path / "rig.toml").read_text().replace("[noise]", '[noise]\nmotor_current = { value = 5, unit = "mA" }')
    (path / "rig.toml").write_text(toml + (f"\n[rig]\ntorque_constant = {constant}\n" if constant else ""))
    return path


def fitted(path):
    experiment = RigExperiment((read_rig_set(path),))
    model = experiment.base_model()
    return calibrated(experiment, model, numbers_of(experiment, model))


def test_the_current_becomes_a_torque_with_the_noise_of_the_current(tmp_path):
    rig = read_rig_set(by_current(tmp_path / "rig"))
    (motor,) = (channel for channel in rig.channels if isinstance(channel, MotorTorque))
    (cell,) = (channel for channel in rig.channels if channel.column == "torque_Nm")
    np.testing.assert_allclose(motor.measured, cell.measured / EFFICIENCY + CONSTANT * NO_LOAD, rtol=1e-4)
    np.testing.assert_allclose(motor.sd, CONSTANT * 0.005)


def test_a_cell_tells_efficiency_and_no_load_current_of_the_motor(tmp_path):
    fit = fitted(by_current(tmp_path / "rig"))
    assert fit.value("rig.motor_torque_scale") == pytest.approx(1 / EFFICIENCY, rel=0.05)
    assert fit.value("rig.motor_torque_tare") == pytest.approx(CONSTANT * NO_LOAD, rel=0.15)


def test_a_stated_uncertainty_of_the_constant_is_the_prior_of_the_scale(tmp_path):
    rig = read_rig_set(by_current(tmp_path / "rig", '{ value = 2000, unit = "mN m/A", sd = 60 }', cell=False))
    assert rig.error_sd["rig.motor_torque_scale"] == pytest.approx(0.03)
    numbers = {number.name: number for number in numbers_of(RigExperiment((rig,)), RigExperiment((rig,)).base_model())}
    assert numbers["rig.motor_torque_scale"].scale == pytest.approx(0.03)
    assert numbers["rig.motor_torque_tare"].prior


@pytest.mark.parametrize(
    ("constant", "message"),
    [("", "torque_constant"), ("{ value = 0.0, unit = 'N m/A' }", "positive"), ("{ value = 2, unit = 'V' }", "'V'")],
)
def test_a_current_without_a_torque_constant_is_refused(tmp_path, constant, message):
    with pytest.raises(DataError, match=message):
        read_rig_set(by_current(tmp_path / "rig", constant))
