"""A resistance against the motion, for traction forms that leave compaction out."""

from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, fading
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class MotionResistance(Effect):
    """A fraction R of the normal force resists the travel, in traction forms that leave the compaction resistance out.

        f_t = -R f_n v / sqrt(v^2 + u^2)

    Eq (7) contains the compaction resistance as a force that pushes even a parked rover backwards. The torque and gross
    forms contain no resistance, and wheels would run at S < 0 on level ground with them. R is one number for a drive.
    It does not depend on the sinkage or on changes of the soil by other effects (`MultiPass`, `HardPatch`,
    `LoadExponent`); effects of digging by slip (`DiggingMemory`, `SlipSinkage`, `SkidSinkage`) bring their own
    resistance. If R is not declared, it is the traction factor F(0.05) of the soil, wheels and load of the drive (0.028
    for Table 1: `simulation.model.cruise.default_resistance`). If R is declared below F(0), driven wheels skid on level
    ground, and the drive reports this.

    The resistance is a Coulomb force: at rest any fraction of it may act. It fades below the travel speed u = v_0 (v_0
    / sqrt(v_0^2 + (r omega)^2))^q (`fading`). u is v_0 for wheels at rest, so that a parked rover is not pushed, and
    less than a tenth of v_0 under a rim at 50 mm/s. On slopes between tan = F(1) - R and tan = F(1), a rover should not
    move while its wheels turn. There it creeps at u x / sqrt(1 - x^2), with x = (F(1) - tan) / R. This error goes to 0
    with v_0.

    Source: assumed (the paper's factor from the torque has no such term). Differs from the compaction resistance by Eqs
    (4) and (7) with Table 1, which is 0.18 of the load.
    """

    title: ClassVar[str] = "motion resistance"
    family: ClassVar[str] = "resistance"
    meaning: ClassVar[str] = "the soil takes a share of the load as a resistance to motion"
    R: Scalar = quantity(0.028, "", "assumed: F(S = 0.05) of the torque form with Table 1", 0.0, 1.0, "R")
    v_0: Scalar = quantity(0.005, "m/s", "assumed: a tenth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    q: Scalar = quantity(1.0, "", "assumed: a tenth of v_0 at 50 mm/s; 0: v_0 even where wheels spin", 0.0, 2.0, "q")
    neutral: ClassVar[dict[str, float]] = {"R": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] that this effect adds, against the direction of travel."""
        return Load(f_t=-self.R * load.f_n * contact.sense(self.v_0, self.q))

    def fading(self, rim: Any) -> Any:
        """Return the minimum travel speed [m/s] of the full resistance, for a wheel with the rim speed `rim` [m/s].
        Below this value, the resistance is reduced.
        """
        return fading(rim, self.v_0, self.q)
