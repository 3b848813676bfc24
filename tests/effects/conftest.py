"""One contact patch and one drive to start from, changed by name."""

import pytest

from rover_pin.contact import Contact, Soil, Wheel
from rover_pin.effects.effect import Drive


@pytest.fixture
def patch():
    """Return a maker of contacts: a wheel at S = 0.4 on Table 1's soil, sunk by 6 mm, unless told otherwise."""
    base = Contact(
        S=0.4,
        S_y=0.0,
        h=0.006,
        v_x=0.03,
        v_y=0.0,
        v_n=0.0,
        rim=0.05,
        x=0.0,
        axle=0.0,
        wheel=Wheel(),
        soil=Soil(k=0.005),
    )
    return base._replace


@pytest.fixture
def drive():
    """Return a maker of drives: half duty at 1 rad/s, a motor of 7.2 V, 24 ohm and 3 N m/A, unless told otherwise."""
    return Drive(delta=0.5, omega=1.0, supply=7.2, resistance=24.0, constant=3.0)._replace
