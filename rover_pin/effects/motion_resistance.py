"""A resistance that opposes motion, for traction forms that leave compaction out."""

from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, fading
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class MotionResistance(Effect):
    """f_t = -R f_n v / sqrt(v^2 + u^2): a fraction R of the load, against the travel.

    Eq (7) holds the compaction resistance as a force that pushes even a parked rover backwards; the torque and gross
    forms have none, and would run at S < 0 on the flat. R is one number for a drive: it follows neither the sinkage nor
    what effects make of the soil (`MultiPass`, `HardPatch`, `LoadExponent`); what slip digs (`DiggingMemory`,
    `SlipSinkage`, `SkidSinkage`) brings its own resistance. Where it is not declared it is F(0.05) of the soil, wheels
    and load as driven (0.028 for Table 1: `simulation.model.cruise.default_resistance`); declared below F(0), driven
    wheels skid on level ground, which the drive says.

    A resistance is Coulomb's: at rest any share of it may act. Below u = v_0 (v_0 / sqrt(v_0^2 + (r omega)^2))^q
    (`fading`) it fades: below v_0 where wheels do not turn, so that a parked rover is not pushed, below a tenth of that
    under a rim at 50 mm/s. Between the slopes tan = F(1) - R and F(1), where a rover should stand with its wheels
    turning, it creeps at u x / sqrt(1 - x^2), x = (F(1) - tan) / R: the error of u, which goes to 0 with v_0.
    Source: assumed (the paper's torque-derived factor has no such term). Differs from compaction by Eqs (4) and (7) on
    Table 1, which is 0.18 of the load.
    """

    title: ClassVar[str] = "motion resistance"
    family: ClassVar[str] = "resistance"
    meaning: ClassVar[str] = "the soil takes a share of the load as a resistance to motion"
    R: Scalar = quantity(0.028, "", "assumed: F(S = 0.05) of the torque form with Table 1", 0.0, 1.0, "R")
    v_0: Scalar = quantity(0.005, "m/s", "assumed: a tenth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    q: Scalar = quantity(1.0, "", "assumed: a tenth of v_0 at 50 mm/s; 0: v_0 even where wheels spin", 0.0, 2.0, "q")
    neutral: ClassVar[dict[str, float]] = {"R": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance."""
        return Load(f_t=-self.R * load.f_n * contact.sense(self.v_0, self.q))

    def fading(self, rim: Any) -> Any:
        """Return u [m/s], the travel speed below which the resistance of a wheel with this rim speed [m/s] fades."""
        return fading(rim, self.v_0, self.q)
