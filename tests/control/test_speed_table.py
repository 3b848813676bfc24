"""Eq (9)'s table is measured on the model that is driven."""

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.control.slip_estimate import TableEstimate, flat_table
from rover_pin.scenarios.scenario import scenario


def test_eq_9s_table_is_that_of_the_driven_model():
    plain, moon, firm = (
        scenario("flat", soil="table-1", **each).model for each in ({}, {"gravity": "moon"}, {"soil.k": 0.005})
    )
    speeds = [float(flat_table(model).speed_at(np.array(0.55))) for model in (plain, moon, firm)]
    assert speeds[0] == pytest.approx(0.05, abs=1e-3)
    assert speeds[1] > speeds[0] + 5e-4
    assert speeds[2] < speeds[0] - 3e-3  # firmer sand resists more
    assert flat_table(scenario("slope", soil="table-1").model) is flat_table(plain)
    for name, model in (("moon", moon), ("table-1", plain)):
        drive = scenario("slope", soil="table-1", control="eq9", **({"gravity": "moon"} if name == "moon" else {}))
        assert isinstance(drive.controller.estimate, TableEstimate)
        assert drive.controller.estimate.table == flat_table(model)


def test_a_model_without_a_table_is_refused():
    """In the net form the rover does not move on its own flat ground."""
    with pytest.raises(ParameterError, match=r"\(9\).*ground"):
        scenario("slope", soil="table-1", control="eq9", form="net")
