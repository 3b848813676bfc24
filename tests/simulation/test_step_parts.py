"""Parts of the compiled step by themselves: solvers, slopes and energies, each against something that knows no C."""

import ctypes
import math

import mpmath as mp
import numpy as np
import pinocchio as pin
import pytest

from rover_pin.effects.supply_sag import SupplySag
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation import native
from rover_pin.simulation.compiled import toolchain
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.rover_numbers import armed
from rover_pin.simulation.plain.step import Plain
from rover_pin.simulation.start.place import Start, settled
from tests.simulation import plain_relaxation as relaxation

SHARE = "static double implicit_share(const Drive *d) { return 0.5; }\n"
NEEDED = "lanes.h types.h shared.py drive.h system.h arc.c states.c solve.c configuration.c".split()
PROBES = """
int probe_pivoted(integer n, const double *a, double *b) {
  double A[MAX_DOF][MAX_DOF];
  for (integer i = 0; i < n; ++i) for (integer j = 0; j < n; ++j) A[i][j] = a[n * i + j];
  return eliminate_pivoted(n, A, b);
}
void probe_states(double half, integer n, const double *a, double *b, integer m, integer stride) {
  double A[MAX_STATES][MAX_STATES];
  for (integer i = 0; i < n; ++i) for (integer j = 0; j < n; ++j) A[i][j] = a[n * i + j];
  implicit_states(half, n, A, b, m, stride);
}
void probe_base(double *q, const double *v, double dt) { advance_base(q, v, dt); }
void probe_turn(double angle, double *out) { turn(angle, out, out + 1); }
void probe_heading(double *q, double angle) { turn_base(q, angle); }
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
    """Inner functions of the step as a library, from the files that they need."""
    text = "".join(SHARE * (name == "solve.c") + native._text(name) for name in NEEDED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", ("-O0", *toolchain.FLAGS[1:]))
        made = toolchain.shared_library(text + PROBES, "parts")
    pointer, integer = ctypes.POINTER(ctypes.c_double), ctypes.c_int64
    made.probe_pivoted.argtypes = [integer, pointer, pointer]
    made.probe_base.argtypes = [pointer, pointer, ctypes.c_double]
    made.probe_turn.argtypes = [ctypes.c_double, pointer]
    made.probe_heading.argtypes = [pointer, ctypes.c_double]
    made.probe_arc.argtypes = [pointer, *[ctypes.c_double] * 3, pointer]
    made.probe_states.argtypes = [ctypes.c_double, integer, pointer, pointer, integer, integer]
    return made


@pytest.mark.parametrize("n", [1, 2, 3, 7, 20])
def test_rows_are_exchanged_where_a_pivot_lacks(parts, n):
    """Dense, with nothing on the diagonal (but of a lone number), so that every row must be another's."""
    rng = np.random.default_rng(n)
    for _ in range(20):
        A, b = rng.normal(size=(n, n)), rng.normal(size=n)
        if n > 1:
            np.fill_diagonal(A, 0.0)
        if abs(np.linalg.det(A)) < 1e-3:
            continue
        x = b.copy()
        assert parts.probe_pivoted(n, at(A), at(x)) == 0
        assert np.linalg.solve(A, b) == pytest.approx(x, rel=1e-8, abs=1e-10)


def test_rows_are_exchanged_for_the_greatest_pivot(parts):
    """With the tiny one first, elimination loses all digits."""
    A, b = np.array([[1e-20, 1.0], [1.0, 1.0]]), np.array([1.0, 2.0])
    assert parts.probe_pivoted(2, at(A), at(b)) == 0
    assert b == pytest.approx([1.0, 1.0], rel=1e-15)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_equations_without_an_answer_are_refused(parts, lost):
    A = np.array([[2.0, 1.0, 0.5], [1.0, 3.0, 0.25], [0.5, 0.25, 4.0]])
    A[lost] = A[:, lost] = 0.0
    assert parts.probe_pivoted(3, at(A), at(np.ones(3))) == 2


@pytest.mark.parametrize(("n", "m", "stride"), [(1, 1, 1), (2, 5, 5), (3, 2, 2), (5, 3, 4), (8, 5, 5)])
def test_the_states_implicit_step_is_a_linear_solve(parts, n, m, stride):
    """(I - half A) X = B with every state bearing every other; what stands beside B is left alone."""
    rng = np.random.default_rng(n)
    A, B = rng.normal(size=(n, n)), rng.normal(size=(n, stride))
    X = B.copy()
    parts.probe_states(0.3, n, at(A), at(X), m, stride)
    assert X[:, :m] == pytest.approx(np.linalg.solve(np.eye(n) - 0.3 * A, B[:, :m]), rel=1e-9, abs=1e-11)
    assert np.array_equal(X[:, m:], B[:, m:])


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
        rest = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        parts.probe_base(at(rest), at(v), 0.0025)
        assert rest[:3] == pytest.approx(move, rel=0.0, abs=5e-16 * np.linalg.norm(v[:3]) * 0.0025)
        assert rest[3:] == pytest.approx(turned, rel=0.0, abs=2.3e-16)
        q = np.concatenate([rng.normal(size=3), pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()])
        wanted = pin.SE3(pin.Quaternion(q[3:]).matrix(), q[:3]) * pin.SE3(pin.Quaternion(turned).matrix(), move)
        parts.probe_base(at(q), at(v), 0.0025)
        assert q[:3] == pytest.approx(wanted.translation, abs=1e-15)
        assert pin.Quaternion(q[3:]).matrix() == pytest.approx(wanted.rotation, abs=2e-15)


@pytest.mark.parametrize("angle", [*ANGLES, *(-angle for angle in ANGLES)])
def test_a_wheel_and_a_heading_turn_to_the_last_digit(parts, angle):
    found = np.zeros(2)
    parts.probe_turn(angle, at(found))
    assert found == pytest.approx([math.sin(angle), math.cos(angle)], rel=2.3e-16, abs=0.0)
    q = np.concatenate([np.zeros(3), pin.Quaternion(pin.exp3(np.array([0.3, -0.2, 0.9]))).coeffs()])
    wanted = pin.exp3(np.array([0.0, 0.0, angle])) @ pin.Quaternion(q[3:]).matrix()
    parts.probe_heading(at(q), angle)
    assert pin.Quaternion(q[3:]).matrix() == pytest.approx(wanted, abs=1e-15)


@pytest.mark.parametrize("n", [0.5, 0.9, 1.0, 1.7])
@pytest.mark.parametrize("h", [1e-4, 0.01, 0.045])
def test_integrals_of_the_depth_over_an_arc(parts, n, h):
    """int (cos t - cos theta_0)^n {cos t, 1} dt from three ends, against adaptive quadrature in 20 digits."""
    radius, found = 0.045, np.zeros((3, 2))
    with mp.workdps(20):
        theta = mp.acos(1 - mp.mpf(h) / mp.mpf(radius))
        ends = np.array([0.0, 0.4 * float(theta), -0.7 * float(theta)])
        parts.probe_arc(at(ends), h, radius, n, at(found))
        for end, (with_cosine, plain) in zip(ends, found, strict=True):
            for got, weight in ((with_cosine, mp.cos), (plain, lambda t: mp.mpf(1))):
                wanted = mp.quad(
                    lambda t, w=weight: max(mp.cos(t) - mp.cos(theta), mp.mpf(0)) ** mp.mpf(n) * w(t), [end, theta]
                )
                assert got == pytest.approx(float(wanted), rel=2e-6)


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_energies_are_those_of_mass_matrix_and_centre_of_mass(name):
    model = scenario("incline", rover=name, **{"terrain.angle_deg": 7.0}).model
    state = settled(model, Start())
    kernel, rng = Kernel(model, state, 0.005, symmetric=False), np.random.default_rng(3)
    state.v[:] = rng.normal(size=len(state.v))
    armoured = armed(model.built, float(model.motor.armature))
    M = pin.crba(armoured, armoured.createData(), state.q)
    kinetic = 0.5 * state.v @ (np.triu(M) + np.triu(M, 1).T) @ state.v
    height = pin.centerOfMass(armoured, armoured.createData(), state.q) @ model.built.up
    assert kernel.energies() == pytest.approx((kinetic, model.built.mass * model.gravity * height), rel=1e-10)


@pytest.mark.parametrize("kind", [Kernel, Plain])
def test_wheels_held_to_a_rate_have_it_and_what_it_takes_is_told(kind):
    """In the air: the torque is that of inverse dynamics for the acceleration that came of it, at half-way speeds."""
    model = scenario("flat").model.having(SupplySag())
    state = settled(model, Start())
    state.q[2] += 0.5
    stepper = kind(model, state, 0.005, False)
    rates = np.linspace(-2.0, 3.0, 6)
    stepper.hold(rates)
    q, v = state.q.copy(), state.v.copy()
    assert stepper.step() == 0
    wheels = [mount.dof for mount in model.rover.wheels]
    assert state.v[wheels] == pytest.approx(rates, abs=1e-6)
    armoured = armed(model.built, float(model.motor.armature))
    half = pin.integrate(armoured, q, 0.0025 * v)
    needed = pin.rnea(armoured, armoured.createData(), half, v, (state.v - v) / 0.005)
    assert stepper.record[:, 9] == pytest.approx(needed[wheels], rel=1e-6)
    before = state.v[wheels].copy()
    assert stepper.step() == 0
    assert state.v[wheels] == pytest.approx(before, abs=1e-6), "held on"


@pytest.mark.parametrize("name", ["flat", "cross-slope", "ditch"])
def test_a_rover_in_hand_comes_to_rest_as_newton_does(name):
    """A step far longer than any motion solves Q + K dq = 0: with the true stiffness what is left falls with the square
    of what there was; with one that is a tenth off, a tenth is left."""
    model = scenario(name).model
    left = []
    for lift in (2e-4, 1e-4, 5e-5):
        state = settled(model, Start())
        held = relaxation.Relaxation(model, state, 0.0, False)
        held._lock(relaxation.SLIDE)
        held._relax(relaxation.IN_HAND)
        rest = state.q.copy()
        state.q[2] -= lift
        held._step(1e3, relaxation.IN_HAND)
        left.append(float(np.abs(state.q - rest).max()) / lift)
    assert left[0] < 0.05
    assert left[1] / left[0] == pytest.approx(0.5, abs=0.15)
    assert left[2] / left[1] == pytest.approx(0.5, abs=0.15)
