"""Laws in SIMD lanes are compared with CasADi's own interpreter, with and without vector functions."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled import toolchain
from rover_pin.simulation.compiled.laws import GEOMETRY, contact_law, numbers, split_law
from rover_pin.simulation.native import lanes


def every_operation():
    """Return a function of three numbers for each lane, one state, and one shared number, which contains every
    operation that a law may use.
    """
    x, state, shared = ca.SX.sym("x", 3), ca.SX.sym("state"), ca.SX.sym("shared")
    a, b, c = ca.vertsplit(x)
    small = ca.tanh(a) / 2
    out = [
        a + b, a - b, a * b, a / b, -a, a * a, a + a, 1 / b, ca.sqrt(ca.fabs(a)), ca.exp(a), ca.expm1(a), ca.exp(c),
        ca.log(ca.fabs(b) + 1), ca.log1p(ca.fabs(b)), ca.sin(a), ca.cos(a), ca.tan(small), ca.asin(small),
        ca.acos(small), ca.atan(a), ca.sinh(a), ca.cosh(a), ca.tanh(a), ca.erf(a), ca.fabs(b) ** a, ca.fabs(b) ** 1.7,
        ca.atan2(a, b), ca.fmax(a, b), ca.fmin(a, b), a <= b, a < b, a == b, a != b, ca.logic_and(a, c),
        ca.logic_or(a, c), ca.logic_not(a), ca.sign(a), ca.if_else(a > b, a, c), state * shared, ca.SX(2.5), ca.SX(0),
    ]  # fmt: skip
    return ca.Function("everything", [x, state, shared], [ca.densify(ca.vertcat(*out))])


def aligned(values):
    room = np.zeros(values.size + 8)
    at = room[(-room.ctypes.data // 8) % 8 :][: values.size]
    at[:] = values.ravel()
    return at


def together(function, *value, shared=()):
    """Call the compiled function for as many cases at once as it has lanes. Each row of `given` is a case."""
    source = lanes.header() + lanes.c_source(function, shared) + "int law_lanes(void) { return LANES; }\n"
    handle = toolchain.shared_library(source, "test_lanes")
    width, rows = handle.law_lanes(), []
    for first in range(0, len(value[0]), width):
        some = [argument[[min(first + k, len(argument) - 1) for k in range(width)]] for argument in value]
        buffers = [aligned(argument[0] if i in shared else argument.T) for i, argument in enumerate(some)]
        out = aligned(np.zeros(function.numel_out(0) * width))
        getattr(handle, function.name())(*(ctypes.c_void_p(argument.ctypes.data) for argument in (*buffers, out)))
        rows.append(out.reshape(-1, width).T)
    return np.concatenate(rows)[: len(value[0])]


@pytest.fixture(params=["this processor", "any processor"])
def build(request, monkeypatch):
    """Compile the function for the vectors of this processor, and for an unknown processor."""
    if request.param == "any processor":
        monkeypatch.setattr(toolchain, "level", lambda: "")


@pytest.mark.usefixtures("build")
def test_every_operation_is_casadis():
    function, rng = every_operation(), np.random.default_rng(0)
    x = rng.normal(0.0, 2.0, (50, 3))
    x[:5] = [[0, 1, 0], [1, 1, 0], [0, -1, 2], [-1, -1, -1], [2, 2, 0]]
    state, shared = rng.normal(size=(50, 1)), np.full((50, 1), 0.3)
    expected = np.array([np.array(function(*case)).ravel() for case in zip(x, state, shared, strict=True)])
    assert together(function, x, state, shared, shared=[2]) == pytest.approx(expected, rel=1e-14, abs=1e-14)


@pytest.mark.usefixtures("build")
def test_a_law_is_casadis():
    """The contact law of a scenario and its derivatives are evaluated over the distances, speeds and states that a
    wheel has in a drive.
    """
    model = scenario("ditch").model
    function = split_law(contact_law(model.contact_effects), len(GEOMETRY))
    rng = np.random.default_rng(1)
    n = 40
    h, speed = rng.uniform(1e-9, 0.04, n), rng.normal(0.0, 0.05, (4, n))
    geometry = np.column_stack([h, *speed, rng.uniform(-1, 1, n), rng.integers(0, 3, n)])
    states = rng.normal(0.0, 0.3, (n, function.during.numel_in(1)))
    constants = numbers([model.rover.wheels[0].wheel, model.soils[0]])
    constants_held = np.tile(np.array(function.before(constants, numbers(model.contact_effects))).ravel(), (n, 1))
    expected = np.array(
        [np.array(function.during(*case)).ravel() for case in zip(geometry, states, constants_held, strict=True)]
    )
    by_lanes = together(function.during, geometry, states, constants_held)
    scale = np.max(np.abs(expected), axis=0) + 1e-300
    assert np.max(np.abs(by_lanes - expected) / scale) < 1e-12


def test_equal_values_are_worked_out_once_and_exp_with_expm1():
    x = ca.SX.sym("x", 2)
    both = ca.expm1(x[0]) + ca.exp(x[0]) * (x[0] * x[1]) - (x[1] * x[0])
    source = lanes.c_source(ca.Function("both", [x], [both]))
    assert source.count("v_expm1(") == 1
    assert "v_exp(" not in source
    assert source.count("* a") == 2


def test_an_operation_that_lanes_do_not_know():
    x = ca.SX.sym("x")
    with pytest.raises(ParameterError, match=r"CasADi's.*OP_FLOOR.*write"):
        lanes.c_source(ca.Function("floored", [x], [ca.floor(x)]))


def cpuinfo(tmp_path, monkeypatch, text, machine="x86_64"):
    file = tmp_path / "cpuinfo"
    file.write_text(text)
    monkeypatch.setattr(toolchain, "CPUINFO", file)
    monkeypatch.setattr(toolchain.platform, "machine", lambda: machine)
    return toolchain.level.__wrapped__()


V3 = toolchain.X86_LEVELS["x86-64-v3"]


@pytest.mark.parametrize(
    ("flags", "machine", "expected"),
    [
        (toolchain.X86_LEVELS["x86-64-v4"], "x86_64", "x86-64-v4"),
        (V3, "x86_64", "x86-64-v3"),
        (V3.replace("fma", ""), "x86_64", ""),
        (V3, "aarch64", ""),
    ],
)
def test_levels(tmp_path, monkeypatch, flags, machine, expected):
    assert cpuinfo(tmp_path, monkeypatch, f"processor : 0\nflags : fpu {flags}\n", machine) == expected
