"""A hard patch: other soil inside, the same outside, slip that answers there and only there."""

import math

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate


def test_inside_and_outside(patch):
    effect, soil = HardPatch(g=0.5, g_k=1.0, dphi=0.03, x_from=1.0, length=0.4), patch().soil
    inside, outside = (effect.amend(patch(x=x), ()).soil for x in (1.2, 0.9))
    assert [float(v) for v in outside.values().values()] == pytest.approx([float(v) for v in soil.values().values()])
    assert float(inside.k_1) == pytest.approx(1.5 * soil.k_1)
    assert float(inside.k) == pytest.approx(0.5 * soil.k)
    assert float(inside.phi) == pytest.approx(soil.phi + 0.03)
    assert float(effect.share(1.0)) == pytest.approx(0.5)
    assert float(effect.share(1.01) - effect.share(0.99)) == pytest.approx(math.tanh(2.0), rel=1e-6)


@pytest.mark.parametrize(("sign", "effect"), [(-1, HardPatch(0.5, 1.0, 0.05)), (1, HardPatch(-0.2, -0.4, -0.05))])
def test_a_drive_slips_otherwise_inside_only(sign, effect):
    """Less on firm ground, more on loose ground, of a wheel that is inside while the rover climbs through."""
    base = scenario("incline", **{"terrain.angle_deg": 4.0, "terrain.start": -3.0}).model
    plain, patched = (
        simulate(model, ConstantDuty(0.6), 20.0)
        for model in (base, base.having(effect.replace(x_from=0.3, length=0.2)))
    )

    def at(trace, x):
        front = trace["body_x"] + 0.15
        return float(np.interp(x, front, trace["slip_fl"])), float(np.interp(x, front, trace["sinkage_fl"]))

    before, inside = at(patched, 0.25)[0] - at(plain, 0.25)[0], at(patched, 0.4)[0] - at(plain, 0.4)[0]
    assert abs(before) < 1e-3
    assert sign * inside > 0.01
    assert sign * (at(patched, 0.4)[1] - at(plain, 0.4)[1]) > 1e-4
