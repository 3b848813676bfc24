"""Compare the paper with itself: its statements on Figs 6, 8 and 10 as measurements, and the changes that satisfy them.

Question
    Table 1 in Eqs (2)-(7) contradicts the text on Figs 6 and 8, and no sand whose F rises reproduces the right half of
    Fig 10. If the statements are treated as residuals of a model, which single change of a constant or added effect
    removes the residuals?
Method
    Eight statements are limits on numbers that F(S) alone determines. Each has an SD (assumed: 0.5 deg, 0.05 to 0.1 of
    slip, 0.01 of F). A satisfied statement has residual 0. The base is Table 1 as printed, with two definitions of the
    traction factor: the net factor (Eq 7, drawbar pull / normal force f_n) and the torque factor (T / (r f_n) with the
    wheel torque T, as in the plots of Fig 6). Every constant of Table 1 and every contact effect of the package without
    internal states is changed alone, and then in pairs, to minimise chi2. A change counts as an improvement if chi2
    falls by more than 2 ln(candidates / 0.05), the detection threshold of the loop.
Result
    Table 1 as printed breaks 5 of 8 statements with the net factor (chi2 1247) and 4 with the torque factor (289). No
    single change satisfies all statements. With the net factor, k matters most. k = 0.5 mm (the smallest value tried)
    leaves chi2 = 15. k = 5 mm instead of 50 leaves chi2 = 527: the rover climbs 12 deg and drives on the flat with
    little slip, but the slip grows gradually, and more slip always gives more pull. With the torque factor, chi2
    remains 246 or more; a small k alone climbs far beyond 18 deg. With two changes, the net factor satisfies all eight
    statements with k of 0.5 to 1.3 mm and a loss at high slip (PostPeak 9 %, a rate loss of 5 %, or PeakStress, which
    these statements cannot distinguish). The torque factor reaches chi2 = 1.2 with k = 7.9 mm and PostPeak 0.52, where
    F no longer rises throughout. Without a loss, k = 0.5 mm with a phi of 12 deg or a smooth rim satisfies all
    statements except the sentence on Fig 10. 'An increasing trend' and 'less slip pulls more' contradict each other, so
    both are satisfied only by a fall of F that the plots of Fig 6 would hardly show.
What the paper says
    The quoted words of `STATEMENTS`; k = 0.05 m. The text mentions a loss past the peak, and Eq (2) has no loss.
What differs
    The data are eight sentences with SDs that we chose. A change that satisfies all of them is possible, not found.
    Wheel speed and rover speed enter as slip only.

Run: python studies/paper_residuals.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from paper.statements import SLIPS, STATEMENTS
from scipy.optimize import minimize

from rover_pin.base.quantity import quantities
from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.estimation.residual import null_gain
from rover_pin.experiments.wheel_rig.candidates import default_effect, rig_kinds
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.plot import COLOURS, save, write_csv
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.wheel_forces import FORMS

WHEEL, TABLE_1 = Wheel(), Soil()
SINKAGE = float(WHEEL.r) * (1 - math.cos(TABLE_1.theta_1))
RIM = 0.05
KEPT = 1.0
"""Maximum distance of a number from the limit that a statement of the paper sets, in SD. Up to this distance the
statement counts as satisfied."""


class Change(NamedTuple):
    """One or two free parameters or effect sizes, with their bounds."""

    effects: tuple[type[Effect], ...]
    names: tuple[str, ...]
    bounds: tuple[tuple[float, float], ...]
    parts: int = 1
    """Number of single changes that this change combines."""

    def plus(self, other: Change) -> Change:
        """Return the change that combines both changes."""
        return Change(
            self.effects + other.effects, self.names + other.names, self.bounds + other.bounds, self.parts + other.parts
        )

    @property
    def label(self) -> str:
        """Return the names of the changed parameters."""
        return " + ".join(self.names) or "nothing"


NOTHING = Change((), (), (), 0)
CONSTANTS = {
    "k": (0.0005, 0.2),
    "phi": (math.radians(10), math.radians(50)),
    "c": (0.0, 5000.0),
    "n": (0.4, 2.0),
    "theta_1": (math.radians(15), math.radians(60)),
    "theta_2": (math.radians(-30), 0.0),
}
LOGARITHMIC = ("k",)
ASKED = (0.005, 0.0145)
"""Values of the shear displacement k [m] that are evaluated without a fit: a tenth of the value in Table 1, and the
value with which the net traction factor (drawbar pull / normal force) climbs 12 deg."""


class Resolved(NamedTuple):
    """The minimum of chi2 for a change: fitted values, chi2, and the residual of each statement."""

    form: str
    change: Change
    values: np.ndarray
    chi2: float
    residuals: np.ndarray

    @property
    def shown(self) -> str:
        """Return a text with the name and the value of each changed parameter; angles are in degrees."""
        texts = []
        for name, value in zip(self.change.names, self.values, strict=True):
            scale, unit = (1e3, " mm") if name == "k" else (math.degrees(1), " deg") if angle(name) else (1.0, "")
            texts.append(f"{name} = {scale * value:.3g}{unit}")
        return ", ".join(texts) or "as it stands"


def angle(name: str) -> bool:
    """Return whether a parameter is an angle."""
    return name in ("phi", "theta_1", "theta_2")


def main() -> None:
    """Fit every change in both forms, print the tables, and write the CSV and the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="single changes only")
    parser.add_argument("--out", type=Path, default=Path("out/paper_residuals"))
    options = parser.parse_args()
    fits = [resolution for form in ("net", "torque") for resolution in resolved(form, options.quick)]
    print(contradictions(fits).to_string(index=False), end="\n\n")
    # Statements that Table 1 itself breaks, by form.
    net, torque = (
        int(np.sum(np.abs(resolution.residuals) > KEPT)) for resolution in fits if not resolution.change.names
    )
    print(f"Table 1 breaks {net} of {len(fits[0].residuals)} in the net form, {torque} in the torque form\n")
    table = ranking(fits)
    for (form, kind), part in table.groupby(["form", "kind"], sort=False):
        print(f"{form} form, {kind}: {min(len(part), 6)} of {len(part)}")
        print(part.head(6).drop(columns=["form", "kind"]).to_string(index=False), end="\n\n")
    print("Eight sentences with SDs that we chose are no data: what keeps them is possible, not found.")
    csv = write_csv(table, options.out / "paper_residuals.csv")
    png = save(draw(fits), options.out / "paper_residuals.png")
    print(f"written: {csv}, {png}")


def singles(form: str) -> list[Change]:
    """Return every single change: each constant of Table 1, and each effect without internal states."""
    changes = [Change((), (name,), (bounds,)) for name, bounds in CONSTANTS.items()]
    for kind in rig_kinds():
        # Effects with internal states depend on the history, so F(S) alone does not describe them.
        if kind.states:
            continue
        declared = quantities(kind())
        names = tuple(f"{kind.__name__}.{name}" for name in kind.neutral)
        # Sizes are searched up to 3 at most.
        bounds = tuple((declared[name].low, min(declared[name].high, 3.0)) for name in kind.neutral)
        changes.append(Change((kind,), names, bounds))
    return changes


def resolved(form: str, quick: bool) -> list[Resolved]:
    """Return the results of the base model, of the values of k in ASKED, of every single change, and of every pair of
    those changes that affect the traction factor F. Each result is a minimum of chi2, except for ASKED.
    """
    alone = [best(form, change) for change in singles(form)]
    base = best(form, NOTHING)
    tenths = [judged(form, singles(form)[0]._replace(parts=0), np.array([k])) for k in ASKED]
    # A parameter that does not affect F alone cannot improve a pair.
    moving = [single.change for single in alone if len(single.change.names) == 1 and moves(form, single.change)]
    pairs = [] if quick else [best(form, a.plus(b)) for a, b in itertools.combinations(moving, 2)]
    return [base, *tenths, *alone, *pairs]


def moves(form: str, change: Change) -> bool:
    """Return whether a value inside the bounds, different from Table 1's value, changes F."""
    inside = np.array([low + 0.37 * (high - low) for low, high in change.bounds])
    return bool(np.abs(np.asarray(curve(form, change)(inside) - curve(form, NOTHING)(np.zeros(0)))).max() > 1e-4)


def best(form: str, change: Change) -> Resolved:
    """Return the minimum of chi2 over the free values, by a grid and Nelder-Mead from its two best points."""
    if not change.names:
        return judged(form, change, np.zeros(0))
    # A coarse grid first, because chi2 has several local minima in k.
    low, high = np.array([scaled(name, ends) for name, ends in zip(change.names, change.bounds, strict=True)]).T
    points = 81 if len(low) == 1 else 17
    grid = np.array(list(itertools.product(*np.linspace(low, high, points).T)))

    def chi2(at_scaled: np.ndarray) -> float:
        return judged(form, change, unscaled(change, np.clip(at_scaled, low, high))).chi2

    costs = np.array([chi2(point) for point in grid])
    starts = grid[np.argsort(costs)[:2]]
    ends = [minimize(chi2, start, method="Nelder-Mead", options={"maxiter": 150, "xatol": 1e-4}) for start in starts]
    least = min(ends, key=lambda end: float(end.fun))
    return judged(form, change, unscaled(change, np.clip(least.x, low, high)))


def scaled(name: str, ends: tuple[float, float]) -> tuple[float, float]:
    """Return the bounds on the search scale: the logarithm for LOGARITHMIC parameters."""
    return (math.log(ends[0]), math.log(ends[1])) if name in LOGARITHMIC else ends


def unscaled(change: Change, values: np.ndarray) -> np.ndarray:
    """Return parameter values from values on the search scale."""
    return np.array([math.exp(x) if n in LOGARITHMIC else x for n, x in zip(change.names, values, strict=True)])


def judged(form: str, change: Change, values: np.ndarray) -> Resolved:
    """Return chi2, and the residual of each statement of the paper, for a change with the given values."""
    F = np.asarray(curve(form, change)(values)).ravel()
    residuals = np.array([statement.residual(F) for statement in STATEMENTS])
    cost = float(residuals @ residuals) if np.isfinite(residuals).all() else 1e9
    return Resolved(form, change, values, cost, residuals)


@lru_cache(maxsize=512)
def curve(form: str, change: Change) -> ca.Function:
    """Return a function of the changed values that gives F = f_t / f_n at `SLIPS`, with Table 1's traction first."""
    traction = SoilTraction(FORMS[form], FixedAngles())
    base = RigModel(WHEEL, TABLE_1, (traction,))
    # Names without a dot are soil constants; the others are sizes of effects.
    values = ca.SX.sym("values", len(change.names))
    by_name = dict(zip(change.names, ca.vertsplit(values), strict=True)) if change.names else {}
    soil = TABLE_1.replace(**{name: value for name, value in by_name.items() if "." not in name})
    effects: list[Effect] = [traction]
    for kind in change.effects:
        named = {name: by_name[f"{kind.__name__}.{name}"] for name in kind.neutral}
        effects.append(default_effect(kind, base).replace(**named))
    S = ca.SX.sym("S")
    factor = ca.Function("F", [S, values], [_factor(effects, S, soil)])
    return ca.Function("curve", [values], [ca.vertcat(*(factor(float(slip), values) for slip in SLIPS))])


def _factor(effects: Sequence[Effect], S: ca.SX, soil: Soil) -> ca.SX:
    """Return F at one slip: the contact amended by every effect, and the sum of their loads."""
    contact = Contact(S, 0.0, SINKAGE, RIM * (1 - S), 0.0, 0.0, RIM, 0.0, 0.0, WHEEL, soil)
    # Effects first amend the contact in their order, and then push in the same order.
    for effect in effects:
        contact = effect.amend(contact, ())
    load = Load()
    for effect in effects:
        load = load.plus(effect.load(contact, load, ()))
    return load.f_t / load.f_n


def contradictions(fits: Sequence[Resolved]) -> pd.DataFrame:
    """Return a table of the paper's statements, with the number that the base model gives for each, in both forms of
    traction.
    """
    rows: dict[str, list[object]] = {
        "statement": [s.words for s in STATEMENTS],
        "number": [s.short for s in STATEMENTS],
    }
    # A limit has one finite side; the other side is infinite.
    rows["limit"] = [
        f">= {s.low:g}" if math.isfinite(s.low) and s.low > -1e9 and s.high == math.inf else f"<= {s.high:g}"
        for s in STATEMENTS
    ]
    for form in ("net", "torque"):
        F = np.asarray(curve(form, NOTHING)(np.zeros(0))).ravel()
        rows[form] = [f"{s.number(F):.3g} ({abs(s.residual(F)):.1f} SD)" for s in STATEMENTS]
    return pd.DataFrame(rows)


def ranking(fits: Sequence[Resolved]) -> pd.DataFrame:
    """Return the ranking of all changes by chi2, with gain, detection threshold and broken statements."""
    base = {resolution.form: resolution.chi2 for resolution in fits if not resolution.change.names}
    # The detection threshold grows with the number of single changes tried.
    count = sum(resolution.change.parts == 1 for resolution in fits if resolution.form == "net")
    rows = []
    for resolution in fits:
        broken = [s.short for s, r in zip(STATEMENTS, resolution.residuals, strict=True) if abs(r) > KEPT]
        parts = resolution.change.parts
        gain = base[resolution.form] - resolution.chi2
        rows.append(
            {
                "form": resolution.form,
                "kind": ("given", "one change", "two changes")[parts],
                "change": resolution.shown,
                "chi2": round(resolution.chi2, 2),
                "gain": round(gain, 1),
                "fee": round(parts * null_gain(count), 1),
                "statements_broken": ", ".join(broken) or "none",
            }
        )
    # The order of kinds is that of the docstring, not alphabetical.
    order = {"given": 0, "one change": 1, "two changes": 2}
    table = pd.DataFrame(rows)
    return table.sort_values(
        ["form", "kind", "chi2"], key=lambda c: c.map(order) if c.name == "kind" else c
    ).reset_index(drop=True)


def draw(fits: Sequence[Resolved]) -> Figure:
    """Return the figure of the traction factor F(S) in the base model and with the best changes, together with the
    slopes that the paper's text states.
    """
    figure = Figure(figsize=(12, 4.6), layout="constrained")
    for axis, form in zip(figure.subplots(1, 2, sharey=True), ("net", "torque"), strict=True):
        of_form = [resolution for resolution in fits if resolution.form == form]
        curves = [of_form[0]]
        # The two best changes of each size, next to the base.
        for parts in (1, 2):
            ranked = sorted(
                (resolution for resolution in of_form if resolution.change.parts == parts),
                key=lambda resolution: resolution.chi2,
            )
            curves += ranked[:2]
        for resolution, colour in zip(curves, COLOURS, strict=False):
            F = np.asarray(curve(form, resolution.change)(resolution.values)).ravel()
            axis.plot(SLIPS, F, color=colour, label=f"{resolution.shown}: chi2 {resolution.chi2:.3g}")
        # A rover that climbs a slope needs F above its tangent.
        for slope, text in ((12.0, "12 deg"), (18.0, "18 deg")):
            axis.axhline(math.tan(math.radians(slope)), color="black", ls=":", lw=1)
            axis.annotate(text, (0.01, math.tan(math.radians(slope))), va="bottom", fontsize=8)
        axis.axhline(0, color="black", lw=0.6)
        axis.set(xlabel="slip ratio S [-]", title=f"{form} form")
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    figure.axes[0].set_ylabel("load-traction factor F [-]")
    return figure


if __name__ == "__main__":
    main()
