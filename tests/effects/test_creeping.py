"""No resistance hangs on the speed but at rest: slow wheels pay what fast ones pay, stalled ones stand."""

import dataclasses

import numpy as np
import pytest

from rover_pin.contact import Load, Soil
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.scenarios.scenario import scenario

RESISTING = {
    "bulldozing": (Bulldozing(), (), 0.3),
    "digging": (DiggingMemory(), (0.004,), 0.3),
    "ploughing": (Ploughing(), (0.8,), -0.4),
    "softening": (SlipSoftening(), (0.9,), 0.2),
    "slip-sinkage": (SlipSinkage(), (), 0.3),
    "skid-sinkage": (SkidSinkage(), (), -0.4),
}


@pytest.mark.parametrize(("effect", "x", "S"), RESISTING.values(), ids=RESISTING)
@pytest.mark.parametrize(("v", "short"), [(0.010, 0.005), (0.005, 0.02)])
def test_a_slow_wheel_pays_what_a_fast_one_pays(patch, effect, x, S, v, short):
    """A locked wheel misses v_0^2 / (2 v^2) of it: 0.5 % at 10 mm/s, 2 % at 5; at v_0 = 5 mm/s it missed 11 and 29."""

    def pull(v, rim):
        contact = patch(S=S, v_x=v, rim=rim, uncompacted=1.0, soil=Soil(n=1.1))
        return float(effect.load(contact, Load(f_n=9.0), x).f_t)

    fast = pull(10.0, 10.0)
    assert fast < -1e-3
    assert pull(v, 0.0) == pytest.approx(fast, rel=short)
    assert pull(v, v) == pytest.approx(fast, rel=2.0 * short**2)


@pytest.mark.parametrize("angle", [6.0, 8.0])
def test_wheels_that_spin_in_their_holes_stand(angle):
    """Their holes hold with 0.4 of the load, Table 1's soil pulls with 0.18 less the slope: they crept at 1.2 mm/s."""
    settings = {"buried": 0.9, "terrain.angle_deg": angle}
    case = scenario("incline", soil="table-1", duration=30.0, add="DiggingMemory", **settings)
    trace = case.drive()
    late = trace.t > trace.t[-1] - 5.0
    assert float(np.mean(trace.stack("wheel_rate")[late])) * 0.045 > 0.02
    assert abs(float(np.mean(trace.stack("travel")[late]))) < 1e-4
    assert trace.attrs["warnings"] == []
    half = dataclasses.replace(case, timing=case.timing.with_half_step()).drive()
    assert half["body_x"][-1] == pytest.approx(trace["body_x"][-1], abs=1e-4)
