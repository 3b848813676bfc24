"""A braking arc that is cut where the shear changes: few nodes are enough, and none are cut where none need be."""

import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.peak_stress import peak_stress_forces
from tests.soil.certified import certified_forces, certified_peak_forces


@pytest.mark.parametrize(("S", "theta_1", "k", "n"), [(-0.95, 0.99, 0.0018, 0.5), (-0.92, 0.85, 0.002, 0.86)])
def test_a_cut_arc_needs_few_nodes(S, theta_1, k, n):
    """Without the layer's cut twenty nodes leave 2e-6, without any 1e-3."""
    wheel, soil, theta_2 = Wheel(), Soil(k=k, n=n, c=1000.0), -0.83 * theta_1
    for few, many in (
        [certified_forces(S, theta_1, theta_2, wheel, soil, nodes=nodes) for nodes in (20, 96)],
        [certified_peak_forces(S, (theta_1, 0.3 * theta_1, theta_2), wheel, soil, nodes=nodes) for nodes in (20, 96)],
    ):
        assert [few.f_n, few.f_t, few.torque / wheel.r] == pytest.approx(
            [many.f_n, many.f_t, many.torque / wheel.r], abs=2e-9 * many.f_n, rel=0.0
        )


@pytest.mark.parametrize(("S", "angles"), [(0.3, (0.6, 0.25, -0.1)), (1.0, (0.9, 0.2, -0.8)), (0.0, (0.4, 0.3, -0.1))])
def test_certified_peak_is_the_plain_one_where_no_cut_is_needed(S, angles):
    """Driving: `peak_stress_forces` takes either side of the peak by a rule and a formula of its own."""
    wheel, soil = Wheel(r=0.06, b=0.04), Soil(c=300.0, k=0.01, n=0.8)
    plain, certified = peak_stress_forces(S, angles, wheel, soil, 60), certified_peak_forces(S, angles, wheel, soil)
    assert list(certified) == pytest.approx(list(plain), abs=1e-7 * plain.f_n)
