"""Where a stretch of other ground lies is found between the places at which it was first tried."""

import math

import pytest

from rover_pin.discrepancy.option import options, singles
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.signature import signatures
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.logs.drive_log import read_drive_log
from tests.experiments.drive_log import drive_sets


@pytest.mark.nightly
def test_the_edges_of_a_patch_are_found(tmp_path):
    hidden = HardPatch(g=1.5, g_k=1.0, dphi=math.radians(4), x_from=0.12, length=0.2)
    log = read_drive_log(drive_sets.write(tmp_path, [hidden]))
    base = drive_sets.calibrated_on(log, with_spread(base_model(log)))
    known = candidates(base.model, base.task.experiment, base.parameters, None)
    (patch,) = options(base, signatures(base, [one for one in known if one.kind == "HardPatch"]))
    found = Search(base)._placed(base, patch)
    effect = found.candidate.effect
    assert singles(base, [found])[0] > singles(base, [patch.signature])[0]
    assert effect.x_from == pytest.approx(0.12, abs=0.03)
    assert effect.x_from + effect.length == pytest.approx(0.32, abs=0.03)
    (sag,) = options(base, signatures(base, [next(one for one in known if one.effect == SupplySag())]))
    assert Search(base)._placed(base, sag) is sag.signature
