"""A resistance that opposes motion, for traction forms that leave compaction out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.quantity import quantity


@dataclass(frozen=True)
class MotionResistance(Effect):
    """f_t = -R f_n v / sqrt(v^2 + v_0^2): a fraction R of the load, against the travel.

    Eq (7) holds the compaction resistance as a force that pushes even a parked rover backwards; the torque and gross
    forms have none, and would run at S < 0 on the flat. R is one number for a drive: it follows neither the sinkage nor
    what effects make of the soil (`MultiPass`, `HardPatch`, `LoadExponent`); what slip digs (`DiggingMemory`,
    `SlipSinkage`, `SkidSinkage`) brings its own resistance. A ready-made drive takes F(0.05) of its named soil (0.028
    for Table 1), whatever `soil.FIELD` is set to; a soil with F(0) > R is then driven at S < 0, where these forms
    create energy. Below v_0 the resistance fades, so that a parked rover is not pushed: what stalls or creeps does so
    at a slope that hangs on v_0.
    Source: assumed (the paper's torque-derived factor has no such term). Differs from compaction by Eqs (4) and (7) on
    Table 1, which is 0.18 of the load.
    """

    title: ClassVar[str] = "motion resistance"
    meaning: ClassVar[str] = "the soil takes a share of the load as a resistance to motion"
    R: Scalar = quantity(0.028, "", "assumed: F(S = 0.05) of the torque form with Table 1", 0.0, 1.0, "R")
    v_0: Scalar = quantity(0.005, "m/s", "assumed: a tenth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"R": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance."""
        return Load(f_t=-self.R * load.f_n * contact.sense(self.v_0))
