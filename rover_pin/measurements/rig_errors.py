"""What a rig itself adds to its readings: tares, zeros, cross-talk, scales; none unless `rig.toml` states them."""

from dataclasses import dataclass

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Load, Scalar


@dataclass(frozen=True)
class RigErrors(Record):
    """What a rig reads of the forces f_t, f_y, torque T, moment M and sinkage h of a wheel under the load W.

    The wheel carries W' = s_W W. Read are s_f f_t + f_0 + x W', s_f s_y f_y + f_y0 by a cell of which s_f scales both
    forces, s_T T + T_0 with T_0 the tare and the friction of bearing and seals, s_h h + h_0, a zero that is off, or a
    radius measured over or under the lugs, and of the moment about the vertical s_M (M - x_0 f_y) + M_0, by a cell
    whose axis stands x_0 ahead of the wheel's centre. A wheel that is pressed in meets s_p times the force that the
    law of rolling has (`experiments.wheel_rig.runs`).
    Neutral is a rig without errors. What `rig.toml` states with an `sd` is a nuisance of every fit, with that prior;
    what it states without one is taken off as it is.
    Source: what rigs do; a constant 1.26 N m was 99 % of one measured set's torque residual.
    """

    torque_tare: Scalar = quantity(0.0, "N m", "none unless [rig] states it", -1e4, 1e4, "T_0")
    pull_tare: Scalar = quantity(0.0, "N", "none unless [rig] states it", -1e5, 1e5, "f_0")
    side_tare: Scalar = quantity(0.0, "N", "none unless [rig] states it", -1e5, 1e5, "f_y0")
    sinkage_zero: Scalar = quantity(0.0, "m", "none unless [rig] states it", -1.0, 1.0, "h_0")
    crosstalk: Scalar = quantity(0.0, "", "share of the load that the pull's cell shows: none", -0.5, 0.5, "x")
    load_scale: Scalar = quantity(1.0, "", "load over that stated: 1", 0.5, 2.0, "s_W")
    force_scale: Scalar = quantity(1.0, "", "reading over force: 1", 0.5, 2.0, "s_f")
    moment_tare: Scalar = quantity(0.0, "N m", "none unless [rig] states it", -1e4, 1e4, "M_0")
    moment_arm: Scalar = quantity(0.0, "m", "taken about the wheel's centre unless [rig] states it", -5.0, 5.0, "x_0")
    torque_scale: Scalar = quantity(1.0, "", "reading over torque: 1", 0.5, 2.0, "s_T")
    sinkage_scale: Scalar = quantity(1.0, "", "reading over sinkage: 1", 0.5, 2.0, "s_h")
    side_scale: Scalar = quantity(1.0, "", "what the side force is scaled by besides s_f: 1", 0.5, 2.0, "s_y")
    moment_scale: Scalar = quantity(1.0, "", "reading over moment: 1", 0.5, 2.0, "s_M")
    pressing_scale: Scalar = quantity(1.0, "", "force of pressing in over that of the law: 1", 0.2, 5.0, "s_p")

    def read(self, forces: Load, h: Scalar, load: Scalar) -> tuple[Scalar, ...]:
        """Return what is read of pull [N], torque [N m], sinkage [m], side force [N], moment [N m] under W' [N]."""
        return (
            self.force_scale * forces.f_t + self.pull_tare + self.crosstalk * load,
            self.torque_scale * forces.torque + self.torque_tare,
            self.sinkage_scale * h + self.sinkage_zero,
            self.force_scale * self.side_scale * forces.f_y + self.side_tare,
            self.moment_scale * (forces.moment_z - self.moment_arm * forces.f_y) + self.moment_tare,
        )
