"""How rounding grows in a drive with an on-board slip estimate, with a known and with an unknown sand."""

import pytest

from rover_pin import scenario

PHI = 0.7155849933176751
"""Angle of friction of the default sand [rad]."""


def spread(believes):
    """Return the largest distance between the ends of three drives whose phi differs by a few units of rounding [m]."""
    settings = {"control": "onboard", "control.believes": believes, "duration": 8.0}
    drives = [
        scenario("ditch", **settings, **{"soil.phi": PHI * (1.0 + change)}).drive(measure_error=False)
        for change in (0.0, 1e-15, 1e-13)
    ]
    ends = [float(drive["body_x"][-1]) for drive in drives]
    return max(ends) - min(ends)


@pytest.mark.slow
def test_a_known_sand_keeps_rounding_small_and_an_unknown_one_does_not():
    assert spread("plant") < 1e-9
    assert 1e-3 < spread("unknown-sand") < 0.3


@pytest.mark.slow
def test_the_summary_of_a_drive_on_unknown_sand_warns_of_its_error():
    trace = scenario("ditch", control="onboard", duration=8.0).drive()
    assert trace.attrs["step_error_m"] > 1e-3
    assert trace.attrs["warnings"]
