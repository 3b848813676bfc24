"""Equations of motion that are written in CasADi, integrated over a measured run by compiled code.

The code is compiled once for each class of experiments and kept on the computer. A run costs one pass over its rows, so
that the time grows in proportion to the number of samples.
"""

import ctypes
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library

LOOP = """
#include <string.h>
/* States x and channels y of one run. u holds the inputs of each integration step at its begin, middle and end, and
   at_rows the inputs at the rows; dt is the time between two rows. A step is one step of RK4. */
void integrate(long rows, long steps, const double* dt, const double* u, const double* at_rows, const double* p,
               double* x, double* y)
{{
    enum {{ N = {states}, M = {inputs}, C = {channels} }};
    double k[4][N], at[N], w[{work} + 1];
    long long iw[{integers} + 1];
    const double* arg[{arguments} + 8];
    double* res[{results} + 8];
    for (long row = 0; row < rows; row++) {{
        arg[0] = x; arg[1] = at_rows + row * M; arg[2] = p; res[0] = y + row * C;
        channels(arg, res, iw, w, 0);
        if (row == rows - 1) break;
        double h = dt[row] / steps;
        for (long step = 0; step < steps; step++, u += 3 * M) {{
            for (int stage = 0; stage < 4; stage++) {{
                double part = stage == 0 ? 0.0 : stage == 3 ? h : h / 2;
                for (int i = 0; i < N; i++) at[i] = stage ? x[i] + part * k[stage - 1][i] : x[i];
                arg[0] = at; arg[1] = u + M * ((stage + 1) / 2); arg[2] = p; res[0] = k[stage];
                rate(arg, res, iw, w, 0);
            }}
            for (int i = 0; i < N; i++) x[i] += h / 6 * (k[0][i] + 2 * (k[1][i] + k[2][i]) + k[3][i]);
        }}
    }}
}}
"""
"""C code of the integration; braces are doubled, because the sizes of the arrays are filled in by `str.format`."""

Motion = Callable[..., tuple[Any, Any]]


class CompiledMotion:
    """Compiled equations of motion of one experiment.

    Parameters
    ----------
    motion : function
        Takes a namespace of numbers, the states and the inputs as CasADi symbols, and returns the time derivatives of
        the states and the channels (see `OverTime.motion`).
    names : sequence of str
        Names of the numbers, in the order in which `run` takes their values.
    states, inputs : int
        Numbers of states and inputs.
    """

    def __init__(self, motion: Motion, names: Sequence[str], states: int, inputs: int):
        self.states, self.names = states, tuple(names)
        x, u, p = (ca.SX.sym(letter, size) for letter, size in (("x", states), ("u", inputs), ("p", len(self.names))))
        numbers = SimpleNamespace(**dict(zip(self.names, ca.vertsplit(p), strict=True)))
        rate, channels = motion(numbers, ca.vertsplit(x), *ca.vertsplit(u))
        self.channels = len(channels)
        functions = [
            ca.Function(name, [x, u, p], [ca.vertcat(*column)])
            for name, column in (("rate", rate), ("channels", channels))
        ]
        sizes = {
            "work": max(function.sz_w() for function in functions),
            "integers": max(function.sz_iw() for function in functions),
            "arguments": max(function.sz_arg() for function in functions),
            "results": max(function.sz_res() for function in functions),
        }
        loop = LOOP.format(states=states, inputs=max(inputs, 1), channels=self.channels, **sizes)
        self._integrate = shared_library(generated_source(*functions, name="motion") + loop, "motion").integrate
        doubles = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
        self._integrate.argtypes = [ctypes.c_long, ctypes.c_long, *[doubles] * 6]
        self._integrate.restype = None

    def run(
        self, intervals: np.ndarray, stages: np.ndarray, at_rows: np.ndarray, p: np.ndarray, start: np.ndarray
    ) -> np.ndarray:
        """Return the channels (rows, channels) of one run.

        Parameters
        ----------
        intervals : array (rows - 1,)
            Time between two rows.
        stages : array (rows - 1, steps, 3, inputs)
            Inputs at the begin, the middle and the end of each integration step.
        at_rows : array (rows, inputs)
            Inputs at the rows.
        p : array (numbers,)
            Values of the numbers.
        start : array (states,)
            States at the first row.
        """
        rows, steps = len(at_rows), stages.shape[1]
        channels = np.empty((rows, self.channels))
        arrays = (np.ascontiguousarray(part, dtype=float) for part in (intervals, stages, at_rows, p))
        self._integrate(rows, steps, *arrays, np.array(start, dtype=float), channels)
        return channels
