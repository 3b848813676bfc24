"""Dead band: nothing inside, a constant step less outside, odd in the duty."""

import pytest

from rover_pin.effects.dead_band import DeadBand


@pytest.mark.parametrize(
    ("delta", "reaching"), [(0.5, 0.42), (-0.5, -0.42), (0.08, 0.0), (0.03, 0.0), (-0.03, 0.0), (0.0, 0.0)]
)
def test_what_reaches_the_motor(drive, delta, reaching):
    assert float(DeadBand(delta_0=0.08).amend(drive(delta=delta), ()).delta) == pytest.approx(reaching, abs=1e-15)
