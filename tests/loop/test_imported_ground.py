"""A cable on recordings of a stranger: other names and units, no link angles, no battery, no word of the ground.

The ground is then estimated from the rover's own attitude. Its error, and the motion resistance that nobody declared,
must not hide the cable behind a confident "nothing".
"""

import numpy as np
import pandas as pd
import pytest

from rover_pin.demo.drive_log import write
from rover_pin.discrepancy.answer import Answer
from rover_pin.importing.import_log import import_log
from rover_pin.loop.close import close_the_loop

CORNERS = {"fl": "FrontL", "fr": "FrontR", "ml": "MidL", "mr": "MidR", "rl": "BackL", "rr": "BackR"}


def strange(source, folder):
    """Write each run with other names and units, and without everything that a plain logger does not have."""
    files = []
    for file in sorted(source.glob("run-*.csv")):
        log = pd.read_csv(file)
        columns = {"Stamp [ms]": 1000.0 * log.t_s + 1.6e12}
        columns |= {f"{axis} [cm]": 100.0 * log[f"body_{axis}"] for axis in "xyz"}
        angles = {"roll": "roll", "pitch": "pitch", "heading": "yaw"}
        columns |= {f"{name} [deg]": np.degrees(log[f"body_{of}"]) for name, of in angles.items()}
        for wheel, name in CORNERS.items():
            columns[f"PWM_{name} [%]"] = 100.0 * log[f"duty_{wheel}"]
            columns[f"omega_{name} [rpm]"] = log[f"wheel_rate_{wheel}"] * 30.0 / np.pi
            columns[f"I_{name} [mA]"] = 1000.0 * log[f"current_{wheel}_A"]
        files.append(folder / file.name)
        pd.DataFrame(columns).to_csv(files[-1], index=False)
    return files


def closed(hidden, folder):
    """Return the verdict of the loop on an imported log. `hidden` is the hidden effect in words, or "nothing"."""
    (folder / "recordings").mkdir()
    write(folder / "drive", hidden, 0)
    import_log(strange(folder / "drive", folder / "recordings"), "nexus6", folder / "log")
    return close_the_loop(folder / "log", jobs=1)


@pytest.mark.nightly
def test_a_cable_is_no_confident_nothing(tmp_path):
    verdict = closed("TetherDrag.f_0=2", tmp_path)
    listed = {name for names in verdict.indistinguishable for name in names.split(" + ")}
    assert verdict.answer in (Answer.NAMED, Answer.SET, Answer.LIKE, Answer.CANNOT_TELL)
    assert "TetherDrag" in {*verdict.named, *listed}
    assert verdict.beliefs.sets[frozenset()] < 0.5
    numbers = {number.name: number for number in verdict.after.numbers}
    if "TetherDrag" in verdict.named:
        assert numbers["TetherDrag.f_0"].low < 2.0 < numbers["TetherDrag.f_0"].high
    # No ground was declared, so that none can differ from its declaration.
    assert verdict.extra.ground.worst is None
    assert 0.0 < verdict.extra.ground.estimate_sd < 0.01


@pytest.mark.nightly
def test_nothing_hidden_names_nothing(tmp_path):
    assert closed("nothing", tmp_path).named == ()
