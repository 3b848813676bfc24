"""Every number of a run with its default, and a batch of runs as arrays. A hidden effect is a number that is not
neutral.
"""

from dataclasses import dataclass, field
from math import radians

import numpy as np

from .vehicle import NEXUS6

PLAIN = {
    "c": 0.005, "phi": radians(30.0), "k": 0.005, "k_1": 54207.3, "n": 1.0,
    "theta_1": radians(35.0), "theta_2": radians(-5.0), "exit_ratio": 1.0 / 7.0,
    "r": 0.045, "b": 0.05, "gravity": 9.81,
    "supply": 7.2, "resistance": 23.852966947475586, "constant": 3.3129120760382755, "armature": 1.005536e-3,
    "relaxation": 0.031, "ringing": 0.1, "damping": 10.0, "R": 0.0, "v_0": 0.005, "side": 1.0,
    "rest": 0.005, "rest_q": 0.0,
    "travel_speed": 0.005, "servo_stiffness": 20.0, "servo_damping": 0.2, "stop_stiffness": 50.0, "stop_damping": 1.0,
}  # fmt: skip
"""The rover, its motors (duty 0.55 drives 0.05 m/s), sand with k = 5 mm; SI. Resistances fade at rest: below 5 mm/s,
as the logs that come along were driven; the package's with rest = 1 mm/s, rest_q = 1: later where rims turn."""

HIDDEN = {
    # wheel and soil
    "SlipSinkage.n_1": 0.0, "SkidSinkage.n_s": 0.0, "ExitAngle.e_1": 0.0,
    "PostPeak.fraction": 0.0, "PostPeak.S_w": 0.4,
    "InterfaceFriction.m": 1.0, "Grousers.h_s": 0.0, "Grousers.lambda_s": 0.5,
    "Bulldozing.share": 0.0, "Bulldozing.gamma": 15700.0,
    "RateDependence.c_r": 0.0, "RateDependence.v_0": 0.01,
    "MultiPass.stiffening": 0.0, "MultiPass.shear_stiffening": 0.0,
    "MotionResistance.R": 0.0, "LoadExponent.n_h": 0.0,
    "PeakStress.share": 0.0, "PeakStress.a_0": 0.40, "PeakStress.a_1": 0.15,
    "DiggingMemory.c_d": 0.0, "DiggingMemory.length": 0.04,
    "HardPatch.x_from": 0.0, "HardPatch.length": 0.3, "HardPatch.g": 0.0, "HardPatch.g_k": 0.0, "HardPatch.dphi": 0.0,
    "WheelScale.e": 0.0,
    # motor
    "GearFriction.tau_c": 0.0, "GearFriction.theta_c": 0.02, "ViscousFriction.b_v": 0.0, "DeadBand.delta_0": 0.0,
    "SupplySag.R_b": 0.0, "SupplySag.tau": 0.1, "WindingHeating.R_th": 0.0, "WindingHeating.tau": 60.0,
    "WeakMotor.g": 0.0, "WeakMotor.wheel": 0.0, "TorqueSaturation.i_max": 1e3,
    # body and world
    "PivotFriction.tau_c": 0.0, "PivotFriction.b": 0.0, "PivotFriction.w_s": 0.02,
    "DifferentialCompliance.compliance": 0.0, "DifferentialCompliance.backlash": 0.0,
    "DifferentialCompliance.relaxation": 0.01,
    "TetherDrag.f_0": 0.0, "TetherDrag.f_1": 0.0, "TetherDrag.x_0": 0.0, "TetherDrag.y_0": 0.0, "TetherDrag.v_0": 0.002,
    "PointMass.m": 0.0, "PointMass.shift_x": 0.0, "PointMass.shift_z": 0.0,
    "GravityTilt.rise_x": 0.0, "GravityTilt.rise_y": 0.0,
    # off-list
    "EccentricWheel.A": 0.0, "EccentricWheel.phase": 0.0, "EccentricWheel.wheel": 0.0,
    "Snag.force": 0.0, "LooseWheel.hold": 1e3, "LooseWheel.wheel": 0.0, "LooseWheel.phase": 0.0,
    "Washboard.A": 0.0, "Washboard.length": 0.1, "Washboard.phase": 0.0,
    # causes of the list by other laws
    "StribeckFriction.tau_s": 0.0, "StribeckFriction.w_s": 0.5, "SquareSag.R_2": 0.0,
    "SpringTether.k": 0.0, "SpringTether.slack": 0.1,
}  # fmt: skip
"""Neutral values; names are those of the effects, off-list ones at the end."""


@dataclass
class Run:
    """One drive: numbers that differ from the defaults, ground, commands, and quantities that vary along the path."""

    numbers: dict = field(default_factory=dict)
    lanes: tuple = (((-1.0, 1.0), (0.0, 0.0)),)
    borders: tuple = ()
    start: tuple = (0.0, 0.0, 0.0)
    "x, y, yaw"
    duty: np.ndarray = None
    "[holds, wheels], one row every HOLD seconds"
    steer: np.ndarray = None
    "[holds, steered wheels]"
    motor_gain: tuple = (1.0,) * 6
    field_x: tuple = (-1.0, 0.1)
    "first place and spacing of the soil's variation"
    strength: np.ndarray = None
    "factor of tan phi along x [2 sides, points]"
    snags: tuple = ()
    "(begin, duration) of each pull [s]"


class World:
    """A batch of runs of one rover as arrays; the last axis is the run: `world["k"]` [runs], `world["motor_gain"]`
    [wheels, runs].
    """

    def __init__(self, runs, vehicle=NEXUS6):
        self.runs, self.vehicle = list(runs), vehicle
        is_known = PLAIN | HIDDEN
        for run in self.runs:
            unknown = set(run.numbers) - set(is_known)
            assert not unknown, f"unknown numbers: {unknown}"
        self.values = {
            name: np.array([float(run.numbers.get(name, is_known[name])) for run in self.runs]) for name in is_known
        }
        self.values["motor_gain"] = np.array([run.motor_gain for run in self.runs], dtype=float).T
        self.size = len(self.runs)

    def __getitem__(self, name):
        return self.values[name]

    def has(self, name):
        """Return whether the number differs from its neutral value in at least one run."""
        return bool(np.any(self.values[name] != HIDDEN[name]))

    def at_wheel(self, name):
        """Return 1 for the wheel with this number and 0 for the others [wheels, runs]."""
        return (np.arange(len(self.vehicle.wheels))[:, None] == np.round(self.values[name])).astype(float)
