"""The soil under a rover's wheels as a passive force of MuJoCo."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import MissingExtraError, SimulationError
from rover_pin.control.mujoco.mjcf import refuse_others
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import stop_reason
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.state import base_rotation
from rover_pin.simulation.timing import Timing


class SoilForces:
    """What the soil of a model does to the wheels of its rover in MuJoCo: `mujoco.set_mjcb_passive(soil)`.

    At every step the compiled step of rover_pin is taken from MuJoCo's state, under MuJoCo's `ctrl`, and its mean force
    and moment of the soil on each wheel are applied at the wheel's centre. The law is stiff near rest; the step is
    linearly implicit in it, by what it expects the speeds to become, so that MuJoCo needs no finer one. What else
    pushes on the rover in MuJoCo (rocks, an arm) moves it, and is not in that expectation. The soil remembers: the
    effects' own states go on with `data.time`, and begin anew where that runs back. MuJoCo compiles no model while such
    a callback is set: set it when all are made, and `None` before the next.

    Parameters
    ----------
    model : Model
        With a rover that `mjcf` has written.
    mj_model : mujoco.MjModel
        What MuJoCo made of it, alone or within a larger world; the names of joints and actuators are looked up.
    start : Start
        As of `mjcf`.
    prefix : str
        Of the names, where the rover is attached to a world with one.

    Raises
    ------
    MissingExtraError
        MuJoCo is not installed.
    ParameterError, SimulationError
        As of `mjcf`; a timestep that this ground does not bear; an integrator that evaluates forces between steps.
    """

    def __init__(self, model: Model, mj_model: Any, start: Start = Start(), prefix: str = ""):
        try:
            import mujoco
        except ImportError as error:
            raise MissingExtraError("MuJoCo is not installed: pip install 'rover-pin[mujoco]'.") from error
        refuse_others(model)
        self._apply, dt = mujoco.mj_applyFT, float(mj_model.opt.timestep)
        if mj_model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise SimulationError("RK4 asks for forces between steps; the soil goes on by whole ones: take another.")
        drive = set_out(model, lambda reading: 0.0, dt, start, Timing(dt, dt, dt))
        if drive.timing.dt < dt:
            raise SimulationError(f"timestep = {dt:g} s: this ground asks for {drive.timing.dt:g} s or less.")
        assert isinstance(drive.stepper, Kernel)
        self._kernel, rover = drive.stepper, model.built
        self._kernel.set_step(dt)
        hinges = [(mj_model.joint(prefix + name), joint) for name, joint in _joints(rover.model)]
        (self._base, _), *others = hinges
        self._hinges = [(int(mine.qposadr[0]), int(mine.dofadr[0]), joint) for mine, joint in others]
        names = [rover.model.names[wheel.joint] for wheel in rover.wheels]
        self._bodies = [int(mj_model.joint(prefix + name).bodyid[0]) for name in names]
        ctrl = [f"duty_{wheel.name}" for wheel in rover.wheels]
        ctrl += [f"steer_{rover.wheels[at].name}" for at in self._kernel.servo_wheels]
        self._ctrl = [int(mj_model.actuator(prefix + name).id) for name in ctrl]
        self._begin = self._saved = self._kernel.saved_arrays()
        self._time, self._signature = -np.inf, mj_model.signature

    def __call__(self, mj_model: Any, data: Any) -> None:
        """Add the soil's forces to `data.qfrc_passive`; of another MuJoCo model nothing."""
        if mj_model.signature != self._signature:
            return
        kernel = self._kernel
        self._go_on(float(data.time))
        self._take(data)
        status = kernel.step()
        if status:
            raise SimulationError(stop_reason(status, float(data.time)))
        for body, load in zip(self._bodies, kernel.mean_loads, strict=True):
            self._apply(mj_model, data, load[:3], load[3:], data.xpos[body], body, data.qfrc_passive)

    def of_wheels(self, name: str) -> np.ndarray:
        """Return what a step's record says of each wheel: slip, sinkage, normal, tangential, lateral, torque ..."""
        return np.array(self._kernel.record[:, RECORD.index(name)])

    def _go_on(self, time: float) -> None:
        """Keep the effects' states where time went on, take them back where the same instant is asked about again."""
        if time < self._time:
            self._kernel.restore(self._begin)
        if time != self._time:
            self._saved, self._time = self._kernel.saved_arrays(), time
        else:
            self._kernel.restore(self._saved)

    def _take(self, data: Any) -> None:
        """Take MuJoCo's state and commands; its base moves by the world's axes, and turns by its own."""
        state, at, dof = self._kernel.state, int(self._base.qposadr[0]), int(self._base.dofadr[0])
        w, *xyz = data.qpos[at + 3 : at + 7]
        state.q[:7] = *data.qpos[at : at + 3], *xyz, w
        turn = base_rotation(state.q)
        state.v[:6] = *(turn.T @ data.qvel[dof : dof + 3]), *data.qvel[dof + 3 : dof + 6]
        for place, speed, joint in self._hinges:
            angle = data.qpos[place]
            state.q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            state.v[joint.idx_v] = data.qvel[speed]
        command, wheels = data.ctrl[self._ctrl], len(self._bodies)
        self._kernel.duty[:] = np.clip(command[:wheels], -1.0, 1.0)
        if len(command) > wheels:
            self._kernel.servo_target[:] = command[wheels:]


def _joints(pin_model: pin.Model) -> Iterator[tuple[str, Any]]:
    """Yield the joints that move, the base's first, with their names."""
    yield from list(zip(pin_model.names, pin_model.joints, strict=True))[1:]
