"""The translation of C to dual numbers, against derivatives by CasADi and by complex steps."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native import lanes
from rover_pin.simulation.native.dual import DUAL_SIZE, TranslationError, dual_laws_source
from tests.simulation.test_lanes import every_operation

NUMBERS = DUAL_SIZE - 1


def evaluate(source, name, inputs, slopes, outputs):
    """Values (outputs,) and derivatives (outputs, NUMBERS) of a translated function of flat inputs."""
    arrays = []
    for value, slope in zip(inputs, slopes, strict=True):
        arrays.append(np.column_stack([value, slope]))
    out = np.full((outputs, DUAL_SIZE), np.nan)
    function = getattr(shared_library(dual_laws_source(source), "test_dual"), name)
    function(*(ctypes.c_void_p(array.ctypes.data) for array in (*arrays, out)))
    return out[:, 0], out[:, 1:]


@pytest.mark.parametrize("seed", range(5))
def test_every_operation_of_a_law_has_casadis_derivative(seed):
    rng, function = np.random.default_rng([7, seed]), every_operation()
    inputs = [rng.normal(size=function.numel_in(k)) for k in range(3)]
    slopes = [rng.normal(size=(function.numel_in(k), NUMBERS)) for k in range(3)]
    values, derivatives = evaluate(lanes.c_source(function), "everything", inputs, slopes, function.numel_out(0))
    symbols = [ca.SX.sym(f"in{k}", function.numel_in(k)) for k in range(3)]
    jacobian = ca.Function("jacobian", symbols, [ca.jacobian(function(*symbols), ca.vertcat(*symbols))])
    np.testing.assert_allclose(values, np.array(function(*inputs)).ravel(), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(
        derivatives, np.array(jacobian(*inputs)) @ np.concatenate(slopes), rtol=1e-11, atol=1e-12
    )


def test_a_comparison_of_a_law_sees_values_only():
    """a == b is true for equal values, whatever their derivatives are."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    function = ca.Function("equal", [a, b], [ca.if_else(a == b, 3.0 * a, b)])
    slopes = [np.eye(NUMBERS)[:1], np.eye(NUMBERS)[1:2]]
    values, derivatives = evaluate(lanes.c_source(function), "equal", [[2.0], [2.0]], slopes, 1)
    assert values.tolist() == [6.0]
    assert derivatives[0].tolist() == [3.0, *[0.0] * (NUMBERS - 1)]


POLYNOMIAL = """
#define TWICE 2.0
#define NEXT (next += 1, next[-1])
typedef double Row __attribute__((vector_size(64), may_alias));
static const double WEIGHTS[3] = {0.5, -1.5, 2.5}; /* plain numbers */
typedef struct { double value, scale[2]; } Pair;
typedef struct Both { Pair first; int count; double *place; } Both;
static double power(double x, double n) { return n == 1.0 ? x : pow(x, n); }
static void add(Both *both, const double *x, double by) {
  both->first.value += by * x[0] / (1.0 + x[1] * x[1]);
  *both->place -= both->first.value;
  if (!(x[0] > x[1])) return;
  ++both->count;
}
void mixed(const double *in, double *out) {
  const double *next = in;
  const double x = NEXT, n = NEXT;
  double sums[4][2] = {{0.0}}, total = 0.0;
  Both both = {.first = {.value = TWICE, .scale = {x, n}}, .place = &sums[1][1]};
  for (int k = 0; k < 3; ++k) {
    add(&both, in + k, WEIGHTS[k]);
    total += k % 2 ? sin(both.first.scale[0]) : -power(both.first.scale[0], both.first.scale[1]);
  }
  Row row = {0};
  row[3] = total;
  row += 2.0 * row * x;
  out[0] = row[3] - n;
  out[1] = ((Pair){x, {n, total}}).scale[1] / fmax(x, n);
  out[2] = sums[1][1] * both.count;
  out[3] = fabs(x - 3.0 * n) * (x > n ? sqrt(x) : exp(n));
}
"""


def mixed(x):
    """POLYNOMIAL once more, for real or complex numbers."""
    value, place, count = 2.0, 0.0, 0
    for k, weight in enumerate((0.5, -1.5, 2.5)):
        value = value + weight * x[k] / (1.0 + x[k + 1] ** 2)
        place = place - value
        count += np.real(x[k]) > np.real(x[k + 1])
    total = -2.0 * x[0] ** x[1] + np.sin(x[0])
    bend = x[0] - 3.0 * x[1]
    larger = x[0] if np.real(x[0]) > np.real(x[1]) else x[1]
    root = np.sqrt(x[0]) if np.real(x[0]) > np.real(x[1]) else np.exp(x[1])
    return np.array(
        [total + 2.0 * total * x[0] - x[1], total / larger, place * count, bend * np.sign(np.real(bend)) * root]
    )


@pytest.mark.parametrize("x", [(1.7, 0.6, -0.4, 2.0), (0.8, 1.0, 0.3, 0.2), (2.5, 1.0, -1.0, 0.5)])
def test_hand_written_c_has_the_derivatives_of_complex_steps(x):
    """Structs, arrays, pointers, rows, macros and branches; also at n = 1, where `power` has a short cut that no
    derivative by n would survive.
    """
    values, derivatives = evaluate(POLYNOMIAL, "mixed", [x], [np.eye(4, NUMBERS)], 4)
    expected = np.column_stack([np.imag(mixed(np.array(x) + 1e-30j * step)) / 1e-30 for step in np.eye(4)])
    np.testing.assert_allclose(values, mixed(np.array(x)), rtol=1e-14)
    np.testing.assert_allclose(derivatives[:, :4], expected, rtol=1e-13, atol=1e-14)
    assert not derivatives[:, 4:].any()


@pytest.mark.parametrize(
    "code",
    [
        "void f(double *out) { out[0] = lgamma(out[1]); }",
        "#if 1\nvoid f(double *out) {}\n#endif",
        "void f(double *out) { *out++ += out[1]; }",
    ],
)
def test_unknown_c_is_refused(code):
    with pytest.raises(TranslationError):
        dual_laws_source(code)
