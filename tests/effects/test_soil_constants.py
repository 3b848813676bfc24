"""Effects that change the soil's constants: each number by hand."""

import math

import pytest

from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.multi_pass import MultiPass


def test_exit_ratio_and_exit_angle_move_alike(patch):
    soil = ExitAngle(e_1=0.3).amend(patch(S=0.5), ()).soil
    assert float(soil.exit_ratio) == pytest.approx(1.0 / 7.0 + 0.15)
    assert float(soil.theta_2) == pytest.approx(-math.radians(5.0) - 0.15 * math.radians(35.0))
    assert float(-soil.theta_2 / soil.theta_1) == pytest.approx(float(soil.exit_ratio))


def test_the_rim_s_angle_replaces_that_of_the_sand(patch):
    m = math.tan(math.radians(20.0)) / math.tan(math.radians(30.0))
    soil = InterfaceFriction(m=m).amend(patch(soil=patch().soil.replace(c=100.0)), ()).soil
    assert float(soil.phi) == pytest.approx(math.radians(20.0))
    assert float(soil.c) == pytest.approx(100.0 * m)


def test_an_exponent_follows_the_depth(patch):
    assert float(LoadExponent(n_h=0.5).amend(patch(h=0.01), ()).soil.n) == pytest.approx(1.0 + 0.5 * 0.01 / 0.05)


def test_each_pass_adds_its_share(patch):
    soil = patch().soil.replace(k_2=1e5)
    for axle in (0.0, 1.0, 2.0):
        pressed = MultiPass(stiffening=0.3, shear_stiffening=0.5).amend(patch(axle=axle, soil=soil), ()).soil
        assert (pressed.k_1, pressed.k_2) == pytest.approx(((1 + 0.3 * axle) * soil.k_1, (1 + 0.3 * axle) * soil.k_2))
        assert pressed.k == pytest.approx(soil.k / (1 + 0.5 * axle))
