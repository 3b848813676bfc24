"""What is tried on a drive log: all that the rover can have, and nothing that it cannot."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Soil
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.experiments.drive_log.candidates import candidate_of, candidates, sized
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.effect_files import package_effects
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.shapes import flat

BENCH = SimpleNamespace(
    channels=(),
    rate_driven=False,
    runs=[SimpleNamespace(commands=SimpleNamespace(place=np.zeros((2, 3)), terrain=None))],
)
OWN = """
from dataclasses import dataclass
from rover_pin.effects.differential_compliance import DifferentialCompliance
@dataclass(frozen=True)
class MyGears(DifferentialCompliance):
    "Mine."
"""


def model(name):
    return Model(load_rover(name), flat(), (Soil(),), Motor())


def tried(name, own=None):
    return {each.kind: each for each in candidates(model(name), BENCH, (), own)}


def test_every_candidate_can_be_added_to_the_rover():
    for name in ("nexus6", "cart"):
        made = model(name)
        assert all(each.effect in each.on(made).all_effects for each in candidates(made, BENCH, (), None))


def test_a_bent_ground_is_no_candidate():
    """The random field of the ground has every slope along the way: a bend beside it would be counted twice."""
    kinds = {kind.__name__ for kind in package_effects() if kind.neutral}
    assert "BentGround" in kinds - tried("nexus6").keys()


def test_differential_and_pivot_effects_need_these_parts(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    parts = {"DifferentialCompliance", "PivotFriction", "SpringDamper", "MyGears"}
    nexus6, cart = tried("nexus6", tmp_path / "mine.py"), tried("cart", tmp_path / "mine.py")
    assert nexus6.keys() - cart.keys() == parts
    assert cart.keys() < nexus6.keys()


def test_the_model_says_why_an_effect_cannot_act():
    cart = model("cart")
    assert "DifferentialCompliance acts in a differential" in cart.refusal(DifferentialCompliance())
    assert "PivotFriction acts in the suspension's pivots, but rover 'cart' has none" in cart.refusal(PivotFriction())
    assert "the rover has no wheel 'ml'" in cart.refusal(TachoScale(wheel="ml"))
    assert "the rover has no wheel 4" in cart.refusal(WeakMotor(wheel=4))
    assert not cart.refusal(DifferentialCompliance(compliance=0.0, backlash=0.0))
    for effect in (PivotFriction(), WeakMotor(wheel=4)):
        assert not model("nexus6").refusal(effect)
        with pytest.raises(ParameterError):
            cart.having(effect)


def test_forces_torques_and_masses_are_tried_in_rover_proportion():
    """A cable of 0.2 N/m behind a rover of 60 kg moved no row by 0.3 SD in all: it was never looked at."""
    cart, nexus = load_rover("cart"), load_rover("nexus6")
    weight, length = cart.mass / nexus.mass, 110.0 / 45.0
    drag = sized(TetherDrag(), cart, 9.81)
    assert (drag.f_0, drag.f_1) == pytest.approx((0.5 * weight, 0.2 * weight / length))
    assert sized(TetherDrag(), cart, 1.62).f_0 == pytest.approx(0.5 * weight * 1.62 / 9.81)
    assert sized(PointMass(), cart, 1.62).m == pytest.approx(0.2 * weight)
    assert sized(PivotFriction(), cart, 9.81).tau_c == pytest.approx(0.03 * weight * length)
    assert sized(TetherDrag(), nexus, 9.81) == TetherDrag()
    assert sized(TachoScale(e=0.02), cart, 9.81) == TachoScale(e=0.02)
    size = candidate_of(drag).size("TetherDrag.f_1")
    assert size.value(1.0) == pytest.approx(drag.f_1)
