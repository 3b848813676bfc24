"""Apply the forces of the soil to a rover's wheels in MuJoCo, as passive forces."""

from typing import Any

import numpy as np

from rover_pin.base.errors import MissingExtraError, SimulationError
from rover_pin.base.extras import install_command
from rover_pin.onboard.mujoco.mjcf import refuse_others
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import stop_reason
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.start import Start
from rover_pin.simulation.state import base_rotation
from rover_pin.simulation.stepping.timing import Timing


class SoilForces:
    """The forces of a model's soil on the wheels of its rover in MuJoCo, as a callback for passive forces.

    Activate the forces by `mujoco.set_mjcb_passive(soil)`. At every step of MuJoCo, rover_pin also takes one step, from
    MuJoCo's state and `ctrl`. The mean force and moment of the soil on each wheel during this step are then applied at
    the centre of the wheel. The law of the soil is stiff near rest, but MuJoCo needs no shorter time step, because the
    step of rover_pin is linearly implicit: it evaluates the law at the speeds that it expects at the end of the step.
    Other forces on the rover in MuJoCo (rocks, an arm) move the rover, but do not change the expected speeds.

    The states of the effects (such as ruts) advance with `data.time`, and are reset when the time runs back. MuJoCo
    cannot compile a model while a callback is set. Set the callback after all models have been compiled, and set the
    callback `None` before another model is compiled.

    Parameters
    ----------
    model : Model
        The model whose rover `mjcf` has written.
    mj_model : mujoco.MjModel
        MuJoCo's model of this rover, alone or within a larger world. Joints and actuators are found by their names.
    start : Start
        Position and heading at which the rover is set down, as given to `mjcf`.
    prefix : str
        Prefix of the names, if the rover has been attached to a world with a prefix.

    Raises
    ------
    MissingExtraError
        MuJoCo is not installed.
    ParameterError
        The model has effects in the motors or on the body.
    SimulationError
        The rover cannot be set down at `start`, the time step is too long for this ground, or MuJoCo's integrator
        evaluates forces between its steps.
    """

    def __init__(self, model: Model, mj_model: Any, start: Start = Start(), prefix: str = ""):
        try:
            import mujoco
        except ImportError as error:
            raise MissingExtraError(f"MuJoCo is not installed. Run `{install_command('mujoco')}`.") from error
        refuse_others(model)
        self._apply, dt = mujoco.mj_applyFT, float(mj_model.opt.timestep)
        if mj_model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise SimulationError(
                "MuJoCo's integrator RK4 evaluates forces several times in a step, but the soil's force is computed "
                "once for each step. Choose another integrator, for example implicitfast."
            )
        drive = set_out(model, lambda reading: 0.0, dt, start, Timing(dt, dt, dt))
        if drive.timing.dt < dt:
            raise SimulationError(
                f"MuJoCo's timestep = {dt:g} s is too long for this ground. Choose {drive.timing.dt:g} s or less."
            )
        assert isinstance(drive.stepper, Kernel)
        self._kernel, rover = drive.stepper, model.built
        self._kernel.set_step(dt)
        # Indices of the rover's joints, bodies and actuators in MuJoCo's arrays.
        hinges = [
            (mj_model.joint(prefix + name), joint)
            for name, joint in list(zip(rover.model.names, rover.model.joints, strict=True))[1:]
        ]
        (self._base, _), *others = hinges
        self._hinges = [(int(mine.qposadr[0]), int(mine.dofadr[0]), joint) for mine, joint in others]
        names = [rover.model.names[wheel.joint] for wheel in rover.wheels]
        self._bodies = [int(mj_model.joint(prefix + name).bodyid[0]) for name in names]
        ctrl = [f"duty_{wheel.name}" for wheel in rover.wheels]
        ctrl += [f"steer_{rover.wheels[i].name}" for i in self._kernel.servo_wheels]
        self._ctrl = [int(mj_model.actuator(prefix + name).id) for name in ctrl]
        self._begin = self._saved = self._kernel.saved_arrays()
        self._time, self._signature = -np.inf, mj_model.signature

    def __call__(self, mj_model: Any, data: Any) -> None:
        """Add the forces of the soil to `data.qfrc_passive`. MuJoCo calls this function in every step.

        If `mj_model` is not the model that was given to the constructor, nothing happens.

        Raises SimulationError: the drive ends, for example because the rover has capsized.
        """
        if mj_model.signature != self._signature:
            return
        kernel, time = self._kernel, float(data.time)
        # If the time runs back, the effects' states are reset to the start. If MuJoCo asks about the same instant
        # again, they are restored to this instant. If time has advanced, the present states are kept.
        if time < self._time:
            kernel.restore(self._begin)
        if time != self._time:
            self._saved, self._time = kernel.saved_arrays(), time
        else:
            kernel.restore(self._saved)
        # Copy MuJoCo's state and commands into the compiled step. MuJoCo has the velocity of the base in the axes of
        # the world, and its angular velocity in those of the base. Pinocchio has both in the axes of the base.
        state, place, dof = kernel.state, int(self._base.qposadr[0]), int(self._base.dofadr[0])
        w, *xyz = data.qpos[place + 3 : place + 7]
        state.q[:7] = *data.qpos[place : place + 3], *xyz, w
        turn = base_rotation(state.q)
        state.v[:6] = *(turn.T @ data.qvel[dof : dof + 3]), *data.qvel[dof + 3 : dof + 6]
        for coordinate, speed, joint in self._hinges:
            angle = data.qpos[coordinate]
            state.q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            state.v[joint.idx_v] = data.qvel[speed]
        command, wheels = data.ctrl[self._ctrl], len(self._bodies)
        kernel.duty[:] = np.clip(command[:wheels], -1.0, 1.0)
        if len(command) > wheels:
            kernel.servo_target[:] = command[wheels:]
        status = kernel.step()
        if status:
            raise SimulationError(stop_reason(status, time))
        # `mj_applyFT` turns each force and moment into generalised forces and adds them to `qfrc_passive`.
        for body, load in zip(self._bodies, kernel.mean_loads, strict=True):
            self._apply(mj_model, data, load[:3], load[3:], data.xpos[body], body, data.qfrc_passive)

    def of_wheels(self, name: str) -> np.ndarray:
        """Return a quantity of each wheel (wheels,) in the last step. `name` is its name in `RECORD`, for example
        `slip`.
        """
        return np.array(self._kernel.record[:, RECORD.index(name)])
