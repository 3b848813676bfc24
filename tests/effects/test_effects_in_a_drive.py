"""All effects in the simulator at once: a neutral one changes nothing, a full set neither diverges nor makes energy."""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest

import rover_pin.effects
from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate

BASE = scenario("incline", **{"terrain.angle_deg": 4.0, "terrain.start": -3.0}).model


def added_effects():
    """Return every effect that has neutral values and is not in the base model."""
    present = {type(each) for each in (*BASE.contact_effects, *BASE.motor_effects)}
    for module in pkgutil.iter_modules(rover_pin.effects.__path__):
        members = inspect.getmembers(importlib.import_module(f"rover_pin.effects.{module.name}"), inspect.isclass)
        for _, kind in members:
            if issubclass(kind, (Effect, MotorEffect, BodyEffect)) and kind.neutral and kind not in present:
                present.add(kind)
                yield kind


def with_all(neutral):
    model = BASE
    for kind in added_effects():
        model = model.having(kind().replace(**kind.neutral) if neutral else kind())
    return model


@pytest.mark.slow  # all effects in one law take half a minute to compile
def test_neutral_effects_leave_a_drive_as_it_is():
    plain, neutral = (simulate(model, ConstantDuty(0.55), 3.0) for model in (BASE, with_all(neutral=True)))
    for name in ("body_x", "body_z", "slip_fl", "torque_rr"):
        assert np.allclose(plain[name], neutral[name], rtol=1e-7, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("duty", [0.55, -0.4])
def test_all_at_once_drive_up_and_down_without_making_energy(duty):
    trace = simulate(with_all(neutral=False), ConstantDuty(duty), 5.0)
    assert np.isfinite(trace["body_x"]).all()
    assert np.abs(trace["body_vx"]).max() < 0.2
    assert trace.energy_error() < 0.01
