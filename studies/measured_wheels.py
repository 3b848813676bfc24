"""Results of the loop on the measured wheels: probabilities of causes, and errors on data that were not fitted.

Question
    Which causes are compatible with the data of measured wheels, how probable is each, and by how much do they reduce
    the error?
Method
    `close_the_loop` runs on every shipped wheel-rig set, and on two pairs of sets jointly, with all its causes: effects
    and errors of the rig. Each level is predicted by fits to the other levels. `together` is the prediction of all
    hypotheses, weighted by their probabilities from the other levels. The comparison includes curves of slip, slip
    angle, load and speed, held out in the same way, and the geometric mean of the error ratio of `together` over all
    channels of all sets.
Result
    studies/results/measured_wheels.csv, which docs/validation.md shows. Of 30 error ratios to curves two are above 1.3:
    braked, pull over a quadratic; smooth, sinkage over a Gaussian process.
What the paper says
    The paper does not use these wheels.
What differs
    Loads, wheels and sands are not those of the paper.

Run: python studies/measured_wheels.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from kept.tables import listed

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.loop.close import close_the_loop

DATA = Path(__file__).parent / "data"
SETS = {
    "smooth wheel": ("cmu-smooth-wheel",),
    "lugged wheel": ("cmu-grousered-wheel",),
    "braked wheel": ("cmu-smooth-wheel-skid",),
    "at slip angles": ("cmu-smooth-wheel-angles",),
    "Ding, smooth": ("ding-2011-smooth",),
    "Ding, lugged": ("ding-2011-lugged",),
    "smooth and braked": ("cmu-smooth-wheel", "cmu-smooth-wheel-skid"),
    "smooth and lugged": ("cmu-smooth-wheel", "cmu-grousered-wheel"),
}
SHOWN = 0.05
"""Minimum probability of a cause in the table."""
CURVES = "quadratic", "Gaussian process"
UNITS = {"drawbar pull": ("N", 1.0), "torque": ("N m", 1.0), "sinkage": ("mm", 1e-3), "side force": ("N", 1.0)}


def main() -> None:
    """Search for the missing effect in every measured data set (`close_the_loop`), write the table after each set, and
    print the ratios of the model's errors to those of simple curves.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the smooth wheel alone")
    parser.add_argument("--out", type=Path, default=Path("out/measured_wheels"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for data, folders in list(SETS.items())[: 1 if options.quick else None]:
        # Two folders are fitted jointly as one set.
        paths = tuple(DATA / folder for folder in folders)
        rows.append(row_of(data, close_the_loop(paths if len(paths) > 1 else paths[0])))
        print(pd.DataFrame(rows[-1:]).T.to_string(header=False), end="\n\n", flush=True)
        pd.DataFrame(rows).to_csv(options.out / "measured_wheels.csv", index=False)
    for curve in CURVES:
        print(f"together over {curve}: {in_words(over(rows, curve))}")
    drawn(rows, options.out / "measured_wheels.png")


def row_of(data: str, verdict: Verdict) -> dict[str, str]:
    """Return a verdict as a row of the table."""
    assert verdict.beliefs is not None
    # Cells are text, so that a page can show the table unchanged.
    return {
        "data": data,
        "answer": verdict.answer.value,
        "sets": " or ".join(verdict.indistinguishable),
        "families": listed(shown(verdict.beliefs.families)),
        "causes": listed(shown(verdict.beliefs.included)),
        "before": errors({score.name: score.before for score in verdict.scores}),
        "after": errors({score.name: score.after for score in verdict.scores}),
        "together": errors(verdict.errors_anew),
        **{
            curve: errors(
                {baseline.channel: baseline.error for baseline in verdict.baselines if baseline.curve == curve}
            )
            for curve in CURVES
        },
    }


def over(rows: Sequence[Mapping[str, str]], curve: str) -> pd.Series:
    """Return for each set and channel the ratio of two held-out errors: the error of all hypotheses together, divided
    by the error of a curve.
    """
    # Both errors are read from the cells of the table, so that the printed ratio belongs to the published numbers.
    pairs = {row["data"]: (missed(row["together"]), missed(row[curve])) for row in rows}
    return pd.Series(
        {
            f"{data}, {name}": together[name] / error
            for data, (together, others) in pairs.items()
            for name, error in others.items()
        }
    )


def missed(text: str) -> dict[str, float]:
    """Return the error of each channel from a cell of the table."""
    return {name: float(error) for name, error in re.findall(r"([a-z][a-z ]+) ([\d.e+-]+) ", f"{text} ")}


def in_words(ratios: pd.Series) -> str:
    """Return the geometric mean and the maximum of the ratios as text."""
    mean = float(np.exp(np.log(ratios).mean()))
    return f"{mean:.2f} in the geometric mean of {len(ratios)} channels, at most {ratios.max():.2f} ({ratios.idxmax()})"


def shown(probabilities: dict[str, float]) -> dict[str, float]:
    """Return those causes whose probability exceeds SHOWN: name -> probability."""
    return {name: probability for name, probability in probabilities.items() if probability > SHOWN}


def errors(by_channel: dict[str, float]) -> str:
    """Return the errors by channel as text, in the units of the table."""
    shown_errors = {name: error for name, error in by_channel.items() if name in UNITS}
    return "; ".join(f"{name} {error / UNITS[name][1]:.3g} {UNITS[name][0]}" for name, error in shown_errors.items())


def drawn(rows: list[dict[str, str]], file: Path) -> None:
    """Draw the probability of each family of causes for each data set, as a map of colours."""
    # The cells hold text such as "digging 0.93; softening 0.05".
    families = {row["data"]: dict(part.rsplit(" ", 1) for part in row["families"].split("; ") if part) for row in rows}
    names = list(dict.fromkeys(name for shares in families.values() for name in shares))
    figure, axis = plt.subplots(figsize=(7.5, 0.4 * len(rows) + 1.8), layout="constrained")
    image = axis.imshow(
        [[float(shares.get(name, 0.0)) for name in names] for shares in families.values()], vmin=0, vmax=1, cmap="Blues"
    )
    axis.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axis.set_yticks(range(len(families)), list(families))
    figure.colorbar(image, label="probability that one of the family acts")
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    main()
