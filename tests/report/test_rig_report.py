"""The page of a verdict on wheel-rig data: slip levels have meanings, models are drawn under the load of each point,
and signs agree.
"""

import numpy as np
import pytest

from rover_pin.contact import Contact, Load, Wheel
from rover_pin.experiments.wheel_rig.describe import channel_residuals, draft_effect
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.parameters import SOILS
from rover_pin.report.rig.figures import channel_panels, load_caption, looks
from rover_pin.report.rig.report import meanings
from tests.experiments.drafts import SameLaw, effect_in
from tests.oracle.rig_generator import TWO_CHANNELS

SLIPS = (-0.7, 0.0, 0.3, 0.6)


def written(folder, loads, slips=SLIPS, extra=""):
    (folder / "rig.toml").write_text(TWO_CHANNELS)
    lines = [f"level,slip,load_N,drawbar_pull_N,sinkage_m{extra and ',slip_angle_rad'}"]
    lines += [
        f"lv{number},{slip},{load},1.0,0.01{extra}"
        for number, (slip, load) in enumerate(zip(slips, loads, strict=True))
    ]
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    return read_rig_set(folder)


def test_levels_are_named_by_their_slip(tmp_path):
    assert meanings(written(tmp_path, (20, 20, 20, 20))) == {
        "lv0": "S = -0.7", "lv1": "S = 0", "lv2": "S = 0.3", "lv3": "S = 0.6",
    }  # fmt: skip


def test_levels_at_slip_angles_state_them(tmp_path):
    assert set(meanings(written(tmp_path, (20, 20, 20, 20), extra=",0.1")).values()) == {
        "S = -0.7", "S = 0", "S = 0.3", "S = 0.6",
    }  # fmt: skip
    lines = (tmp_path / "points.csv").read_text().replace("0.3,20,1.0,0.01,0.1", "0.3,20,1.0,0.01,0.2")
    (tmp_path / "points.csv").write_text(lines)
    assert "S = 0.3, 11.5 deg" in meanings(read_rig_set(tmp_path)).values()


def test_the_model_is_drawn_under_the_load_of_each_point(tmp_path):
    """At S = -0.7 the load is smaller by a third. The curve there is the model's prediction for this load."""
    data = written(tmp_path, (14.0, 21.0, 21.0, 21.0))
    model = RigModel(Wheel(), SOILS["dry-sand"])
    figure = channel_panels(data, looks(model, None, ""))[1]
    (curve,) = [line for line in figure.axes[0].lines if line.get_label() == "base model, fitted"]
    drawn = np.interp(-0.7, curve.get_xdata(), curve.get_ydata())
    assert drawn == pytest.approx(1e3 * model.predict(14.0, -0.7).sinkage[0], rel=1e-6)
    assert drawn != pytest.approx(1e3 * model.predict(19.25, -0.7).sinkage[0], rel=0.05)
    assert load_caption(data).endswith(": 14 to 21 N.")


def test_offset_quadratic_in_the_load_is_described_and_drafted(tmp_path):
    """A load cell may have such an offset: the residual is 2 w + 12 w^2 N at every slip, with w = W / mean W - 1."""
    slips, loads = np.repeat([0.0, 0.2, 0.4, 0.6], 3), np.tile([20.0, 30.0, 40.0], 4)
    data = written(tmp_path, loads, slips=slips)
    w = loads / 30.0 - 1
    missing = np.array([(2 * w + 12 * w**2) / 0.3, np.zeros(12)])
    left = channel_residuals(data, missing)
    assert left[0].powers == pytest.approx([0.0], abs=1e-9)
    assert left[0].of_load == pytest.approx([2.0, 12.0])
    assert left[0].is_curved
    assert not left[1].is_curved
    assert "+2 (W / mean W - 1) +12 (W / mean W - 1)^2 N" in left[0].sentence
    drafted = draft_effect(data, left)
    law = SameLaw(drafted.effect, effect_in(drafted.text, tmp_path))
    contact = Contact(0.2, 0.0, 0.01, 0.05, 0.0, 0.0, 0.06, 0.0, 0.0, Wheel(), SOILS["dry-sand"])
    for load, share in zip((20.0, 30.0, 40.0), w[:3], strict=True):
        added = law.load(contact, Load(f_n=load), ())
        assert float(added.f_t) == pytest.approx(load / 30 * (2 * share + 12 * share**2))
        assert float(added.torque) == 0.0
