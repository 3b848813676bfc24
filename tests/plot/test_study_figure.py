"""Figures of sweeps and tunings: they show every finished case, and the title counts the failed cases."""

import numpy as np
import pandas as pd
import pytest

from rover_pin.plot.study import study_figure
from rover_pin.plot.tuning import tuning_figure

CASES = 8


def table(**more):
    """Return the table of a study as a sweep writes it."""
    steps = np.arange(CASES, dtype=float)
    columns = {"case": range(CASES), "repeat": 0, "seed": 1, "key": "k", "soil.k": 1e-3 * 2.0**steps}
    columns |= {"terrain.angle": np.radians(steps % 3), "control": ["none", "eq9"] * (CASES // 2)}
    columns |= {"distance_m": steps / 10.0, "stop": "duration", "error": None}
    return pd.DataFrame({**columns, **more})


UNITS = {"soil.k": "m", "terrain.angle": "rad", "control": ""}


def drawn(figure):
    """Return the labels of both axes and the points of every panel."""
    return [
        (
            axes.get_xlabel(),
            axes.get_ylabel(),
            np.ma.concatenate([collection.get_offsets() for collection in axes.collections]),
        )
        for axes in figure.axes
        if axes.get_xlabel()
    ]


def test_two_numbers_and_a_word_give_a_map_and_a_row_of_panels():
    figure = study_figure("mine", table(), UNITS, ["soil.k"])
    panels = drawn(figure)
    assert [words[:2] for words in panels] == [
        ("soil.k [m]", "terrain.angle [deg]"),
        ("soil.k [m]", ""),
        ("soil.k [m]", "distance [m]"),
        ("terrain.angle [deg]", ""),
    ]
    assert [len(points) for *_, points in panels] == [CASES / 2, CASES / 2, CASES, CASES]
    assert {axes.get_title() for axes in figure.axes} >= {"control = eq9", "control = none"}
    assert all(axes.get_xscale() == "log" for axes in figure.axes if axes.get_xlabel() == "soil.k [m]")
    assert max(panels[-1][2][:, 0]) == pytest.approx(2.0)  # degrees


def test_failed_cases_are_left_out_and_counted():
    failed = table(error=["Diverged", *[None] * (CASES - 1)])
    figure = study_figure("mine", failed, UNITS)
    assert figure.get_suptitle() == "mine: 8 cases, 1 failed and are not shown"
    assert len(drawn(figure)[-1][2]) == CASES - 1


def test_words_alone_are_shown_case_by_case():
    (panel,) = drawn(study_figure("mine", table().drop(columns=["soil.k", "terrain.angle"]), {"control": ""}))
    assert panel[0] == "case"


def test_a_tunings_figure_has_every_drive_of_both_sets():
    controls = ["constant duty", "torque check", "before, true", "tuned, true", "before, eq9", "tuned, eq9"]
    rows = [
        (where, f"drive {n}", control, n + 0.1 * place)
        for where, count in (("training", 3), ("held out", 2))
        for n in range(count)
        for place, control in enumerate(controls)
    ]
    figure = tuning_figure(pd.DataFrame(rows, columns=["set", "drive", "control", "cost"]), "mine")
    above, below = figure.axes
    assert [label.get_text() for label in above.get_yticklabels()] == ["drive 0", "drive 1", "drive 2"]
    assert [label.get_text() for label in below.get_yticklabels()] == ["drive 0", "drive 1"]
    (legend,) = figure.legends
    assert [label.get_text() for label in legend.get_texts()] == [
        *controls[:2], "before, true slip", "tuned, true slip", "before, eq9 slip", "tuned, eq9 slip",
    ]  # fmt: skip
    (tuned,) = (line for line in above.lines if line.get_label() == "tuned, true slip")
    assert list(tuned.get_xdata()) == pytest.approx([0.3, 1.3, 2.3])
