"""What the compiled step is given of a model: room for what it works with, whose wheels turn, what it accounts for."""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled import rover_numbers
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.start.place import Start, settled
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import Lanes

FLAT = scenario("flat").model


def kernel_of(model):
    return Kernel(model, settled(model, Start()), 0.005, symmetric=False)


def test_there_is_room_for_what_the_largest_wheel_meets():
    """Points every 5 mm: twice the radius, twice the facets; wheels of both sizes on one rover."""
    random = np.random.default_rng(0)
    x = np.arange(-2.0, 2.0, 0.005)
    ground = Lanes((Profile(x, 1e-4 * random.normal(size=len(x))),), ())
    rover = FLAT.built

    def facets(factors):
        wheels = tuple(
            dataclasses.replace(mount, wheel=mount.wheel.replace(r=factor * float(mount.wheel.r)))
            for mount, factor in zip(rover.wheels, factors, strict=True)
        )
        made = dataclasses.replace(FLAT, rover=dataclasses.replace(rover, wheels=wheels), terrain=ground)
        state = settled(FLAT, Start())
        return len(Kernel(made, state, 0.005, symmetric=False).keep["facets"])

    small, large = facets([1.0] * 6), facets([2.0] * 6)
    assert large > small
    assert facets([1.0] * 5 + [2.0]) == facets([2.0] + [1.0] * 5) == large


def test_kernel_without_energy_balance_moves_equally():
    told, ends = [], []
    for accounts in (True, False):
        kernel = kernel_of(FLAT)
        if not accounts:
            kernel.disable_energy_balance()
        kernel.duty[:] = 0.5
        assert [kernel.step() for _ in range(20)] == [0] * 20
        told.append(bool(kernel.energy.any()))
        ends.append(kernel.state.q.copy())
    assert told == [True, False]
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize(("limit", "most"), [("MAX_DOF", 20), ("MAX_COLS", 10)])
def test_a_rover_with_more_joints_than_the_step_holds_is_refused(limit, most, monkeypatch):
    """Nexus 6 has 20 degrees of freedom: 6, four rockers, four servos, six wheels; 10 at most are above a wheel."""
    made = rover_numbers.rover_fields.__wrapped__
    monkeypatch.setattr(rover_numbers, limit, most)
    made(FLAT.built, 1e-3, 1.0, True, False)
    monkeypatch.setattr(rover_numbers, limit, most - 1)
    with pytest.raises(ParameterError, match=r"20 degrees.*10"):
        made(FLAT.built, 1e-3, 1.0, True, False)
