"""The compiled step: the data that it gets from a model, a rover and a terrain, and its own properties."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rover_pin import Motor, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.simulation.compiled import drive_fields
from rover_pin.simulation.compiled.drive_fields import line_of, terrain_fields
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.native.shared import N_FACET, N_PATCH
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.start import Start, settled_state
from rover_pin.terrain.terrain import Lanes, Profile
from tests.simulation import kernel_cases as cases

FLAT = scenario("flat").model


def kernel_of(model):
    return Kernel(model, settled_state(model, Start()), 0.005, symmetric=False)


def test_there_is_room_for_the_facets_under_the_largest_wheel():
    """With a point every 5 mm, twice the radius means twice the number of facets. One rover has wheels of
    both sizes.
    """
    random = np.random.default_rng(0)
    x = np.arange(-2.0, 2.0, 0.005)
    ground = Lanes((Profile(x, 1e-4 * random.normal(size=len(x))),), ())
    rover = FLAT.built

    def facets(factors):
        wheels = tuple(
            dataclasses.replace(mount, wheel=mount.wheel.replace(r=factor * float(mount.wheel.r)))
            for mount, factor in zip(rover.wheels, factors, strict=True)
        )
        changed_flat = dataclasses.replace(FLAT, rover=dataclasses.replace(rover, wheels=wheels), terrain=ground)
        state = settled_state(FLAT, Start())
        return len(Kernel(changed_flat, state, 0.005, symmetric=False).keep["facets"])

    small, large = facets([1.0] * 6), facets([2.0] * 6)
    assert large > small
    assert facets([1.0] * 5 + [2.0]) == facets([2.0] + [1.0] * 5) == large


def test_kernel_without_energy_balance_moves_equally():
    traces, ends = [], []
    for accounts in (True, False):
        kernel = kernel_of(FLAT)
        if not accounts:
            kernel.disable_energy_balance()
        kernel.duty[:] = 0.5
        assert [kernel.step() for _ in range(20)] == [0] * 20
        traces.append(bool(kernel.energy.any()))
        ends.append(kernel.state.q.copy())
    assert traces == [True, False]
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize(("limit", "most"), [("MAX_DOF", 20), ("MAX_COLS", 10)])
def test_a_rover_with_more_joints_than_the_step_holds_is_refused(limit, most, monkeypatch):
    """Nexus 6 has 20 degrees of freedom: 6 of the base, four rockers and bogies, four servos and six wheels. At most 10
    of them move one wheel.
    """
    uncached = drive_fields.rover_fields.__wrapped__
    monkeypatch.setattr(drive_fields, limit, most)
    uncached(FLAT.built, 1e-3, 1.0, True, False)
    monkeypatch.setattr(drive_fields, limit, most - 1)
    with pytest.raises(ParameterError, match=r"20 degrees.*10.*pinocchio-crba"):
        uncached(FLAT.built, 1e-3, 1.0, True, False)


def test_a_drive_and_a_rest_write_nothing_that_drives_share():
    case = scenario("turn", duration=1.0)
    shared = kernel_of(case.model).fixed
    before = {name: array.copy() for name, array in shared.keep.items()}
    plain = bytes(shared.struct)
    trace = case.drive()
    assert kernel_of(case.model).fixed is shared
    assert bytes(shared.struct) == plain
    assert not any(array.flags.writeable for array in shared.keep.values())
    assert all(np.array_equal(array, before[name]) for name, array in shared.keep.items())
    assert np.array_equal(case.drive()["body_x"], trace["body_x"])


@pytest.mark.parametrize(
    "change",
    [
        lambda model: model.having(PointMass(m=1.0, shift_x=0.02)),
        lambda model: model.having(GravityTilt(rise_x=0.05)),
        lambda model: dataclasses.replace(model, gravity=1.62),
        lambda model: dataclasses.replace(model, motor=Motor(gear=100.0, rotor_inertia=2e-8)),
    ],
    ids=["ballast", "tilt", "moon", "rotor"],
)
def test_a_drive_between_two_others_of_the_rover_changes_neither(change):
    model = scenario("flat").model
    drives = [
        simulate(model_driven, lambda reading: np.full(6, 0.5), 0.5)["body_x"]
        for model_driven in (model, change(model), model)
    ]
    assert np.array_equal(drives[0], drives[2])
    assert not np.array_equal(drives[0], drives[1])


ROVER, CASES = cases.ROVER, cases.CASES


@pytest.mark.parametrize("kind", [Kernel, PlainStepper])
def test_steps_that_are_taken_back_leave_nothing_behind(kind):
    """The motor has a current and a supply voltage, and the gears have a wind-up, which the next step reads as well."""
    model = CASES["two-widths"][0].having(SupplySag())
    state = settled_state(model, Start())
    stepper = kind(model, state, 0.005, False)
    stepper.duty[:] = np.linspace(0.4, 0.9, 6)
    for _ in range(5):
        stepper.step()
    saved = stepper.saved_arrays()
    ends = []
    for _ in range(2):
        stepper.restore(saved)
        assert [stepper.step() for _ in range(4)] == [0] * 4
        ends.append([stepper.misjudged, *(saved_array.tobytes() for saved_array in stepper.saved_arrays())])
    assert ends[0] == ends[1]


def test_changed_soils_act_as_if_present_from_the_start():
    model, start = CASES["eq-1"]
    firmer = tuple(soil.replace(phi=soil.phi * 1.1) for soil in model.soils)
    state = settled_state(model, start)
    duplicate = state.copy()
    kernel = Kernel(model, state, 0.005, symmetric=False)
    fresh = Kernel(dataclasses.replace(model, soils=firmer), duplicate, 0.005, symmetric=False)
    kernel.set_soils(np.array([list(soil.values().values()) for soil in firmer]))
    for _ in range(100):
        kernel.duty[:] = fresh.duty[:] = 0.7
        assert (kernel.step(), fresh.step()) == (0, 0)
    assert np.array_equal(state.q, duplicate.q)
    assert np.array_equal(kernel.record, fresh.record)


RANDOM = np.random.default_rng(2)
X = np.cumsum(RANDOM.uniform(0.01, 0.4, 40)) - 3.0
ROUGH = Profile(X, 0.1 * RANDOM.normal(size=40), RANDOM.integers(0, 2, 39))
STEP = Profile(np.array([-1.0, 0.5, 0.6, 2.0]), np.array([0.0, 0.0, 0.08, 0.08]))


@pytest.mark.parametrize("length", [0.05, 0.3, 1.0, 9.0])
def test_the_crowd_is_the_most_points_within_a_length(length):
    line = line_of(ROUGH)
    assert line.crowd(length) == max(np.sum((line.x >= x) & (line.x <= x + length)) for x in line.x)


def test_there_is_room_for_all_facets_that_a_wheel_can_meet():
    """The examined ground is 2.1 radii long. It contains the points within this length, a piece at each end and one
    piece beyond, and patches on all lanes.
    """
    fields = terrain_fields(Lanes((ROUGH, STEP), (0.25,)), 0.4)
    needed = [line_of(profile).crowd(2.1 * 0.4) + 4 for profile in (ROUGH, STEP)]
    assert needed[0] > needed[1]
    assert fields["facets"].shape == (needed[0], N_FACET)
    assert fields["patches"].shape == (sum(needed), N_PATCH)
