"""Parts of the compiled step by themselves, each against something that knows no C."""

import ctypes
import math

import mpmath as mp
import numpy as np
import pinocchio as pin
import pytest

from rover_pin import load_rover, scenario
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.rover.forward_dynamics import constraint_rows
from rover_pin.simulation import native
from rover_pin.simulation.compiled import kernel as module
from rover_pin.simulation.compiled import toolchain
from rover_pin.simulation.compiled.drive_fields import model_with_armature
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native.compiled_body import elimination
from rover_pin.simulation.outcome.audit import pivot_warning
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.start import Start, settled_state
from rover_pin.simulation.state import suspension_dofs

PROBES = """
void probe_base(double *q, const double *v, double dt) { advance_base(q, v, dt); }
void probe_arc(const double *ends, double h, double radius, double n, double *out) {
  const Arc arc = arc_of(h, radius);
  double found[N_ENDS][2];
  depth_integrals(ends, &arc, n, found);
  memcpy(out, found, sizeof found);
}
"""


def at(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


@pytest.fixture(scope="module")
def parts():
    """The step as a library, with doors to inner functions."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", ("-O0", *toolchain.FLAGS[1:]))
        library = toolchain.shared_library(native.source() + PROBES, "parts")
    pointer = ctypes.POINTER(ctypes.c_double)
    library.probe_base.argtypes = [pointer, pointer, ctypes.c_double]
    library.probe_arc.argtypes = [pointer, *[ctypes.c_double] * 3, pointer]
    return library


ANGLES = [0.0, 1e-9, 1e-4, 0.03, 0.09, 0.0999999, 0.1000001, 0.2, 1.5, 3.0]


def screw(v, dt):
    """exp of a twist (u, w) dt in 40 digits: translation, and the quaternion (x, y, z, w)."""
    with mp.workdps(40):
        u, w = (mp.matrix([mp.mpf(float(x)) * mp.mpf(dt) for x in part]) for part in (v[:3], v[3:]))
        W = mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        angle = mp.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
        a = (1 - mp.cos(angle)) / angle**2 if angle else mp.mpf(1) / 2
        b = (angle - mp.sin(angle)) / angle**3 if angle else mp.mpf(1) / 6
        s = mp.sin(angle / 2) / angle if angle else mp.mpf(1) / 2
        move = u + a * (W * u) + b * (W * (W * u))
        return np.array([float(x) for x in move]), np.array([*(float(s * x) for x in w), float(mp.cos(angle / 2))])


@pytest.mark.parametrize("angle", ANGLES)
def test_the_base_moves_along_a_screw_to_the_last_digit(parts, angle):
    """Half a step at a steady twist, by series below a tenth of a radian and by sines above."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        axis = rng.normal(size=3)
        v = np.concatenate([rng.normal(size=3), 400.0 * angle * axis / np.linalg.norm(axis)])
        move, turned = screw(v, 0.0025)
        values = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        parts.probe_base(at(values), at(v), 0.0025)
        assert values[:3] == pytest.approx(move, rel=0.0, abs=5e-16 * np.linalg.norm(v[:3]) * 0.0025)
        assert values[3:] == pytest.approx(turned, rel=0.0, abs=2.3e-16)
        q = np.concatenate([rng.normal(size=3), pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()])
        wanted = pin.SE3(pin.Quaternion(q[3:]).matrix(), q[:3]) * pin.SE3(pin.Quaternion(turned).matrix(), move)
        parts.probe_base(at(q), at(v), 0.0025)
        assert q[:3] == pytest.approx(wanted.translation, abs=1e-15)
        assert pin.Quaternion(q[3:]).matrix() == pytest.approx(wanted.rotation, abs=2e-15)


@pytest.mark.parametrize("n", [0.5, 0.9, 1.0, 1.7])
@pytest.mark.parametrize("h", [1e-4, 0.01, 0.045])
def test_integrals_of_the_depth_over_an_arc(parts, n, h):
    """int (cos t - cos theta_0)^n {cos t, 1} dt from three ends, against adaptive quadrature in 20 digits."""
    radius, values = 0.045, np.zeros((3, 2))
    with mp.workdps(20):
        theta = mp.acos(1 - mp.mpf(h) / mp.mpf(radius))
        ends = np.array([0.0, 0.4 * float(theta), -0.7 * float(theta)])
        parts.probe_arc(at(ends), h, radius, n, at(values))
        for end, (with_cosine, plain) in zip(ends, values, strict=True):
            for got, weight in ((with_cosine, mp.cos), (plain, lambda t: mp.mpf(1))):
                wanted = mp.quad(
                    lambda t, w=weight: max(mp.cos(t) - mp.cos(theta), mp.mpf(0)) ** mp.mpf(n) * w(t), [end, theta]
                )
                assert got == pytest.approx(float(wanted), rel=2e-6)


@pytest.mark.parametrize("kind", [Kernel, PlainStepper])
def test_wheels_held_to_a_rate_have_it_and_report_the_torque(kind):
    """In the air: the torque is that of inverse dynamics for the acceleration that came of it, at half-way speeds."""
    model = scenario("flat").model.having(SupplySag())
    state = settled_state(model, Start())
    state.q[2] += 0.5
    stepper = kind(model, state, 0.005, False)
    rates = np.linspace(-2.0, 3.0, 6)
    stepper.hold(rates)
    q, v = state.q.copy(), state.v.copy()
    assert stepper.step() == 0
    wheels = [mount.dof for mount in model.rover.wheels]
    assert state.v[wheels] == pytest.approx(rates, abs=1e-6)
    armoured = model_with_armature(model.built, float(model.motor.armature))
    half = pin.integrate(armoured, q, 0.0025 * v)
    needed = pin.rnea(armoured, armoured.createData(), half, v, (state.v - v) / 0.005)
    assert stepper.record[:, 9] == pytest.approx(needed[wheels], rel=1e-6)
    before = state.v[wheels].copy()
    assert stepper.step() == 0
    assert state.v[wheels] == pytest.approx(before, abs=1e-6), "held on"


MODEL = scenario("flat").model


def test_a_plain_step_reports_numbers_that_are_not_finite():
    begun = settled_state(MODEL, Start())
    begun.v[0] = math.nan
    assert PlainStepper(MODEL, begun, 0.005, False).step() == 1


def test_plain_step_returns_a_forced_differential_to_its_tie():
    """The compiled step, which eliminates the follower, keeps what it was given: drives begin tied."""
    begun, rover = settled_state(MODEL, Start()), MODEL.built
    begun.v[rover.differential.left] = 0.3
    G = constraint_rows(rover)
    assert np.abs(G @ begun.v).max() == pytest.approx(0.3)
    assert PlainStepper(MODEL, begun, 0.005, False).step() == 0
    assert np.abs(G @ begun.v).max() < 1e-9


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


@pytest.mark.parametrize("is_held", [True, False])
@pytest.mark.parametrize("pushed", [True, False])
@pytest.mark.parametrize("name", ["nexus6", "cart", "nexus6_links"])
def test_elimination_within_the_listed_entries_solves(name, pushed, is_held):
    rover = load_rover(name)
    together = [*range(6), *suspension_dofs(rover)] if pushed else []
    coupled = [(coupling.follower, coupling.leader) for coupling in rover.couplings]
    if is_held and rover.differential is not None:
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


def test_wheels_depend_only_on_the_joints_that_carry_them():
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
        changed_library, original = shared_library(source.replace(old, new), "changed"), module.library()
        for name in ("rover_pin_step", "rover_pin_hold", "rover_pin_sizes"):
            getattr(changed_library, name).argtypes = getattr(original, name).argtypes
        monkeypatch.setattr(module, "library", lambda: changed_library)

    return take


def beside(case, change):
    """A kernel of the usual step and one of the changed one, 200 steps on."""
    state = settled_state(case.model, case.start)
    kernels = [Kernel(case.model, state.copy(), 0.005, symmetric=False)]
    change()
    kernels.append(Kernel(case.model, state.copy(), 0.005, symmetric=False))
    for stepper in kernels:
        stepper.duty[:] = 0.5
        assert [stepper.step() for _ in range(200)] == [0] * 200
    return kernels


@pytest.mark.parametrize("least", [2.0, 0.9])
def test_a_small_pivot_is_solved_with_exchanged_rows_and_reported(changed, least):
    """A step that takes every pivot for too small gives the same drive, and counts; so if it is half done by then."""
    case = scenario("ditch")
    plain, second = beside(case, lambda: changed("#define LEAST_PIVOT 1e-12", f"#define LEAST_PIVOT {least}"))
    assert second.state.q == pytest.approx(plain.state.q, rel=1e-9, abs=1e-11)
    assert second.differential == pytest.approx(plain.differential, rel=1e-7)
    assert (plain.pivoted, second.pivoted) == (0, 200)
    _, fine = beside(case, lambda: changed("#define LEAST_PIVOT 1e-12", "#define LEAST_PIVOT 1e-3"))
    assert fine.pivoted == 0, "a share of what stood on the diagonal, whatever its unit"
    assert pivot_warning(0) == ""
    assert "200 steps" in pivot_warning(200)
