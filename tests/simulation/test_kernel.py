"""What the compiled step is given of a model: room for what it works with, whose wheels turn, what it accounts for."""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled import laws as laws_of
from rover_pin.simulation.compiled import rover_numbers
from rover_pin.simulation.compiled.body_law import body_law
from rover_pin.simulation.compiled.constant_part import split_law
from rover_pin.simulation.compiled.generated_laws import compiled_laws, structure_of
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.native.library import aligned
from rover_pin.simulation.start.place import Start, settled
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import Lanes

FLAT = scenario("flat").model


def kernel_of(model):
    return Kernel(model, settled(model, Start()), 0.005, symmetric=False)


@pytest.mark.parametrize("model", [FLAT, FLAT.having(GravityTilt(rise_x=0.05))], ids=["flat", "tilt"])
def test_workspace_fits_the_laws_and_the_rigid_body(model):
    kernel, laws = kernel_of(model), compiled_laws(structure_of(model))
    for name, needed in zip(("work_i", "work_w"), zip(laws.work, kernel.fixed.body.work, strict=True), strict=True):
        assert kernel.keep[name].size == max(needed)
    assert laws.work[1] != kernel.fixed.body.work[1], "else the room for one would do for both"


def test_the_laws_say_what_the_functions_among_them_work_with():
    """Of the constants and of what pushes the body; the laws over lanes have room of their own."""
    model = FLAT.having(TetherDrag())
    structure = structure_of(model)
    before = split_law(laws_of.contact_law(structure.contact), len(laws_of.GEOMETRY)).before
    pushed = body_law(structure.body_effects, structure.joints)
    assert pushed.sz_w() != before.sz_w()
    made = compiled_laws(structure)
    assert made.work == (max(before.sz_iw(), pushed.sz_iw()), max(before.sz_w(), pushed.sz_w()))
    assert made.body not in (0, made.contact, made.motor)
    assert compiled_laws(structure_of(FLAT)).body == 0, "nothing pushes"


def test_rovers_that_nothing_pushes_share_their_laws():
    cart = scenario("flat", rover="cart").model
    assert structure_of(dataclasses.replace(FLAT, rover=cart.rover)) == structure_of(FLAT)
    assert structure_of(FLAT.having(TetherDrag())) != structure_of(
        dataclasses.replace(FLAT, rover=cart.rover).having(TetherDrag())
    )


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


@pytest.mark.parametrize("count", [0, 1, 7, 8, 100])
def test_room_for_lanes_begins_where_a_row_of_lanes_may(count):
    for _ in range(8):
        room = aligned(count)
        assert (room.size, room.ctypes.data % 64) == (count, 0)
        assert not room.any()
