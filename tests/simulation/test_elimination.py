"""The order in which the step's equations are solved, and what happens where it does not do."""

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation import native
from rover_pin.simulation.compiled import kernel as module
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.suspension import suspension_dofs
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native.compiled_body import elimination
from rover_pin.simulation.outcome.audit import pivot_warning
from rover_pin.simulation.start.place import settled


def coupled_system(model, coupled, together, rng):
    """A random positive matrix with a tree's zeros, followers folded into their leaders, and its free velocities."""
    data = model.createData()
    M = np.array(pin.crba(model, data, pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))))
    A = np.triu(M) + np.triu(M, 1).T + np.eye(model.nv)
    A[np.ix_(together, together)] += rng.uniform(-0.01, 0.01, (len(together), len(together)))
    for follower, leader in coupled:
        A[leader] -= A[follower]
        A[:, leader] -= A[:, follower]
    return A


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("pushed", [True, False])
@pytest.mark.parametrize("name", ["nexus6", "cart", "nexus6_links"])
def test_elimination_within_what_is_listed_solves(name, pushed, held):
    rover = load_rover(name)
    together = [*range(6), *suspension_dofs(rover)] if pushed else []
    coupled = [(each.follower, each.leader) for each in rover.couplings]
    if held and rover.differential is not None:
        coupled.append((rover.differential.right, rover.differential.left))
    rng = np.random.default_rng(0)
    A = coupled_system(rover.model, coupled, together, rng)
    order, above = elimination(rover.model, coupled, together)
    assert sorted(order) == sorted(set(range(rover.model.nv)) - {follower for follower, _ in coupled})
    b = rng.normal(size=rover.model.nv)
    expected = np.linalg.solve(A[np.ix_(order, order)], b[order])
    for k, left in zip(order, above, strict=True):
        assert left[:6] == list(range(min(6, k))), "the step takes the base's columns as one row"
        for i in left:
            factor = A[i, k] / A[k, k]
            A[i, left] -= factor * A[k, left]
            b[i] -= factor * b[k]
    for k, left in list(zip(order, above, strict=True))[::-1]:
        b[k] = (b[k] - A[k, left] @ b[left]) / A[k, k]
    assert b[order] == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_wheels_meet_only_what_bears_them():
    """Of Nexus 6's 20 velocities a front wheel meets the base's, its steering's and the left rocker's."""
    rover = load_rover("nexus6")
    order, above = elimination(rover.model, [(rover.differential.right, rover.differential.left)], [])
    front = next(wheel for wheel in rover.wheels if wheel.name == "fr")
    assert above[order.index(front.dof)] == [*range(6), rover.differential.left, front.steer_dof]


@pytest.fixture
def changed(monkeypatch):
    """A function (old line, new line) -> the step compiled with it, which kernels then take."""

    def take(old, new):
        source = native.source()
        assert source.count(old) == 1
        other, usual = shared_library(source.replace(old, new), "changed"), module.library()
        for name in ("rover_pin_step", "rover_pin_hold", "rover_pin_sizes"):
            getattr(other, name).argtypes = getattr(usual, name).argtypes
        monkeypatch.setattr(module, "library", lambda: other)

    return take


def beside(case, change):
    """A kernel of the usual step and one of the changed one, 200 steps on."""
    state = settled(case.model, case.start)
    kernels = [Kernel(case.model, state.copy(), 0.005, symmetric=False)]
    change()
    kernels.append(Kernel(case.model, state.copy(), 0.005, symmetric=False))
    for stepper in kernels:
        stepper.duty[:] = 0.5
        assert [stepper.step() for _ in range(200)] == [0] * 200
    return kernels


@pytest.mark.parametrize("least", [2.0, 0.9])
def test_a_small_pivot_is_solved_with_exchanged_rows_and_told(changed, least):
    """A step that takes every pivot for too small gives the same drive, and counts; so if it is half done by then."""
    case = scenario("ditch")
    plain, other = beside(case, lambda: changed("#define LEAST_PIVOT 1e-12", f"#define LEAST_PIVOT {least}"))
    assert other.state.q == pytest.approx(plain.state.q, rel=1e-9, abs=1e-11)
    assert other.differential == pytest.approx(plain.differential, rel=1e-7)
    assert (plain.pivoted, other.pivoted) == (0, 200)
    _, fine = beside(case, lambda: changed("#define LEAST_PIVOT 1e-12", "#define LEAST_PIVOT 1e-3"))
    assert fine.pivoted == 0, "a share of what stood on the diagonal, whatever its unit"
    assert pivot_warning(0) == ""
    assert "200 steps" in pivot_warning(200)
