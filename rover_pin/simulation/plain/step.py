"""The step in plain NumPy, with the rigid-body dynamics of Pinocchio's own algorithms: slow and readable. The compiled
step (native/step.c) is tested against it, and the engines `pinocchio-crba` and `pinocchio-aba` take it.

One step of Eq (8), the equation of motion, has the convergence order two. The configuration moves by half a step, the
velocities change by a two-stage Rosenbrock method with the forces at this configuration, and the configuration moves by
the other half of the step. With the velocities u, the states x of the effects, the soil's generalised force Q(u, x),
the motors' generalised force tau(u), the bias force nle, the mass matrix M and the step dt,

    q <- q (+) dt/2 u,    F = Q + tau - nle,    D = dQ/du + dQ/dx dx/du + dtau/du,    gamma = 1 - 1/sqrt(2),
    (M - gamma dt D) k_1 = dt F + G^T lambda_1,    (M - gamma dt D) k_2 = M k_1 + G^T lambda_2,
    du = gamma k_1 + (1 - gamma) k_2,    G (u + du) = 0,    u <- u + du,    q <- q (+) dt/2 u.

G contains the constraints (the differential and coupled joints), and lambda their forces. This method was chosen for
its stability: with z = dt M^-1 D, a decaying motion is multiplied by (1 + (1 - 2 gamma) z) / (1 - gamma z)^2. This is
exp(z) to second order, and 0 for motions that are far faster than the step (L-stable); with the midpoint rule, motors
would ring until the next command.

The mean force of the step is F + D w, where w = gamma (k_1 + (1 - gamma) k_2) takes the place of du/2. The effects'
states change by dx = (I - dt/2 r_x)^-1 dt (r + r_u w) with the rates r = dx/dt, and half of dx enters Q. Steering
servos, end stops and body effects are taken fully implicitly: dt times their slopes is added to M. Forces that depend
on u are therefore stable however stiff they are. The forces of the soil that depend on q act like springs of some 2
kN/m at each wheel; they are explicit and limit the step (`stepping/resolution.py`).

Pinocchio computes everything that concerns the rigid bodies: `pin.integrate` moves the configuration,
`pin.computeJointJacobians` and `pin.getJointJacobian` give frames and Jacobians of the wheels, and the two equations
for k_1 and k_2 are solved with `pin.crba` (`composite.py`) or with `pin.aba` (`articulated.py`). The laws of contact,
motors and body effects are CasADi functions that CasADi's own interpreter evaluates.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II (1996), sections IV.6 and IV.7.
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from rover_pin.rover.forward_dynamics import constraint_rows
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.body_law import body_law
from rover_pin.simulation.compiled.drive_fields import SERVO_GAIN, STOP_GAIN, joint_strength, model_with_armature
from rover_pin.simulation.compiled.kernel import HOLDING_INERTIA, StepArrays
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import GAMMA, RECORD
from rover_pin.simulation.plain.composite import Slopes, StageEquations, Stages, composite_stages
from rover_pin.simulation.plain.law import PlainLaw
from rover_pin.simulation.state import DriveState, joints_of, suspension_dofs, suspension_places
from rover_pin.simulation.stepping.pace import growth
from rover_pin.terrain.section import Facet, Patch, WheelFrame, patches, wheel_frame

SLIP, SLIP_Y, SINKAGE, NORMAL, TANGENTIAL, LATERAL, SOIL_TORQUE, TRAVEL, PATCHES, TORQUE, CURRENT, SUPPLY = range(
    len(RECORD)
)
"""Indices of the columns of the array `record`, which holds the quantities of the wheels; they have the order of
RECORD."""


class PlainStepper(StepArrays):
    """The step of a model in NumPy and Pinocchio: slow and readable. It is one of the two classes that advance a drive
    (`Stepper`), and has the attributes of the other, `Kernel`, which is compiled.

    Parameters
    ----------
    model, state : Model, DriveState
        The model to drive, and its state, which the steps change (`StepArrays`).
    dt : float
        Length of the steps [s].
    symmetric : bool
        Keep the motion mirror-symmetric about the x-z plane.
    stages : callable
        Solver of the step's equations for k_1 and k_2: `composite_stages`, which uses Pinocchio's CRBA, or
        `articulated_stages`, which uses its ABA.
    """

    def __init__(
        self,
        model: Model,
        state: DriveState,
        dt: float,
        symmetric: bool,
        stages: Callable[[StageEquations], Stages] = composite_stages,
    ):
        super().__init__(model, state)
        self.dt, self.symmetric, self.stages = dt, symmetric, stages
        self.rover, self.ground = model.built, model.ground
        self.pin_model = model_with_armature(self.rover, float(model.motor.armature))
        self.data = self.pin_model.createData()

        # Derivative of each wheel's load by the change du of the speeds, and the numbers that decide whether a step is
        # repeated.
        self.load_slopes = np.zeros((len(self.rover.wheels), 6, self.pin_model.nv))
        self.wheel_share = model.wheel_share
        self.misjudged, self.growth, self.pivoted = 0.0, 0.0, 0

        self.held_rate: np.ndarray | None = None
        self.servo_dofs = [wheel.steer_dof for wheel in self.rover.wheels if wheel.steer_dof is not None]

        # Laws of contact, motor and body, and their parameters.
        self.law = PlainLaw(model)
        self.motor = laws.as_numbers(laws.motor_law(model.motor, model.motor_effects))
        self.motor_parameters = laws.numbers([model.motor, *model.motor_effects])
        self.body = laws.as_numbers(body_law(model.body_effects, joints_of(self.rover)))

    def set_step(self, dt: float) -> None:
        """Set the length of the following steps [s]."""
        self.dt = dt

    def hold(self, rates: np.ndarray) -> None:
        """From now on, turn the wheels at these rates (wheels,) [rad/s] instead of driving them by the motors.

        The array is not copied: the caller may change the rates in place.
        """
        self.held_rate = rates

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy of the rover in its present state [J]."""
        kinetic = pin.computeKineticEnergy(self.pin_model, self.data, self.state.q, self.state.v)
        return kinetic, pin.computePotentialEnergy(self.pin_model, self.data, self.state.q)

    def step(self) -> int:
        """Advance the state by dt. Return 0 if the step succeeded, or 1 if a velocity is not finite."""
        state, nv, n = self.state, self.pin_model.nv, len(self.rover.wheels)
        # First half of the configuration's step, at the old speeds.
        state.q[:] = pin.integrate(self.pin_model, state.q, 0.5 * self.dt * state.v)
        pin.computeJointJacobians(self.pin_model, self.data, state.q)

        # Forces there, each with its slope with the speeds. A sagging supply feels the currents of the last step, which
        # are read before the record is cleared.
        self.bus = float(self.duty @ self.record[:, CURRENT])
        self.soil_Q, self.soil_D = np.zeros(nv), np.zeros((nv, nv))
        self.record[:], self.loads[:], self.load_slopes[:], self.misjudged = 0.0, 0.0, 0.0, 0.0
        self.begun, self.end, self.end_slope = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4, nv))
        contact_steps = [self._wheel(index) for index in range(n)]
        motor_Q, motor_D, motor_steps = self._motors()
        spring_Q, spring_D = self._springs()
        push_Q, push_D = self._push()

        # Change of the speeds, and the change w that belongs to the mean force.
        du, mean_du = self._solve(
            self.soil_Q + motor_Q + spring_Q + push_Q, Slopes(self.soil_D, motor_D, spring_D, push_D)
        )

        # Store the loads that are predicted for the end, and the mean loads.
        self.foreseen[:] = self.end + self.end_slope @ du
        self.mean_loads[:] = self.loads + self.load_slopes @ mean_du
        motor = motor_Q + motor_D * mean_du
        if self.held_rate is not None:
            self.record[:, TORQUE] = motor[[wheel.dof for wheel in self.rover.wheels]]

        # Each energy of the step is a generalised force, as mean over the step, times the mean speed v + du/2 times dt.
        # Servos and end stops share one vector of forces; their energies are counted separately.
        speed = state.v + 0.5 * du
        soil, springs, push = self.soil_Q + self.soil_D @ mean_du, spring_Q + spring_D * du, push_Q + push_D @ du
        stops = springs.copy()
        stops[self.servo_dofs] = 0.0
        electric = float(np.sum(self.record[:, CURRENT] * self.record[:, SUPPLY] * self.duty))
        servos = (springs - stops) @ speed
        self.impulse += self.dt * self.loads[:, :3].sum(axis=0)
        self.energy += self.dt * np.array(
            [motor @ speed, -(soil @ speed), -(stops @ speed), -servos, electric, -(push @ speed)]
        )

        # The effects' states, the speeds, and the second half of the configuration's step.
        for index, (gain, slope) in enumerate(contact_steps):
            state.contact[index] += gain + slope @ mean_du
        for wheel, row, (gain, slope) in zip(self.rover.wheels, state.motor, motor_steps, strict=True):
            row += gain + slope * mean_du[wheel.dof]
        state.v += du
        if self.symmetric:
            perm, sign = self.rover.mirror
            state.v[:] = 0.5 * (state.v + np.asarray(sign) * state.v[np.asarray(perm)])
        state.q[:] = pin.integrate(self.pin_model, state.q, 0.5 * self.dt * state.v)
        return 0 if np.all(np.isfinite(state.v)) else 1

    def _solve(self, force: np.ndarray, slopes: Slopes) -> tuple[np.ndarray, np.ndarray]:
        """Return the change of the speeds in a step, du, and the change of the speeds at which the mean force of the
        step acts, w; both are arrays (nv,).

        The docstring of the module contains the equations.

        Parameters
        ----------
        force : array (nv,)
            Generalised force without the bias force.
        slopes : Slopes
            Derivatives of the force by the speeds.
        """
        rigid = self.rover.differential is not None and self.model.rigid_differential
        G = constraint_rows(self.rover, differential=rigid)
        equations = StageEquations(self.pin_model, self.data, self.state.q, self.state.v, self.dt, G, force, slopes)
        (first, second, third), impulses = self.stages(equations)
        du, mean_du = GAMMA * first + (1.0 - GAMMA) * second, GAMMA * (first + (1.0 - GAMMA) * second)
        # The third solution shows whether forces push a speed away faster than the step can follow.
        self.growth = growth(first, second, third)
        # The multiplier of the differential's constraint is its impulse; without the constraint, an effect gives it.
        self.differential[0] = (
            (impulses[0] + (1.0 - GAMMA) * impulses[1])[0] / self.dt if rigid else self.torque + self.torque_slope @ du
        )
        return du, mean_du

    def _wheel(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Add the loads of all contact patches of one wheel to the generalised force of the soil, and return the change
        of the wheel's effect states in this step.

        The change is returned as a constant c (states,) and a matrix A (states, nv): the states change by c + A w,
        where w is the change of the speeds at which the mean force of the step acts (`_solve`).
        """
        # Find the patches under the wheel at its present position.
        mount = self.rover.wheels[index]
        centre = self.data.oMi[mount.joint].translation.copy()
        J = pin.getJointJacobian(self.pin_model, self.data, mount.joint, pin.LOCAL_WORLD_ALIGNED)
        frame = wheel_frame(centre, J[3:, mount.dof].copy())
        exponents = [float(soil.n) for soil in self.model.soils]
        contacts, sinkage = patches(self.ground, frame, float(mount.wheel.r), float(mount.wheel.b), exponents)
        # The states of a wheel in the air are advanced with a patch that carries no load.
        nx = self.state.contact.shape[1]
        airborne = not contacts
        if airborne and nx:
            below = Facet(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), frame.up, 0)
            contacts = [Patch(1e-9, 0.0, 0.0, 0.0, 0.0, below)]
        if not contacts:
            return np.zeros(nx), np.zeros((nx, J.shape[1]))
        weights, gains, slopes = [], [], []
        for patch in contacts:
            weight, gain, slope = self._patch(index, frame, J, patch)
            weights.append(weight)
            gains.append(weight * gain)
            slopes.append(weight * slope)

        # Forecast error: load per normal force now, minus the value that the last step predicted. A wheel that carries
        # less than its equal share of the weight counts less.
        now, before = self.begun[index], self.foreseen[index]
        if now[2] > 0.0 and before[2] > 0.0:
            arms = [1.0, 1.0, 1.0, float(mount.wheel.r)]
            error = float((np.abs(now / now[2] - before / before[2]) / arms).max())
            self.misjudged = max(self.misjudged, error * min(1.0, now[2] / self.wheel_share))

        # Slips, travel speed and states are means over the patches, weighted by the normal force.
        self.record[index, [SLIP, SLIP_Y, TRAVEL]] /= sum(weights)
        self.record[index, SINKAGE] = sinkage
        self.record[index, PATCHES] = 0.0 if airborne else len(contacts)
        return np.sum(gains, axis=0) / sum(weights), np.sum(slopes, axis=0) / sum(weights)

    def _patch(
        self, index: int, frame: WheelFrame, J: np.ndarray, patch: Patch
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Add the load of one contact patch to the generalised force of the soil. Return the weight of the patch, and
        the change of the wheel's effect states that this patch alone would cause.

        The weight is the normal force; the means over the patches of a wheel are computed with these weights. The
        change is returned as a constant c (states,) and a matrix A (states, nv): the states change by c + A w, where w
        is the change of the speeds at which the mean force of the step acts (`_solve`).
        """
        mount, N = self.rover.wheels[index], patch.facet.normal
        r, velocity = float(mount.wheel.r), J[:3] @ self.state.v
        # Directions in the patch's plane: t forwards along the ground, `side` to the left.
        t = np.cross(frame.axle, N)
        t /= np.linalg.norm(t)
        side = np.cross(N, t)
        # The law's speeds v_x, v_y, v_n and rim are linear in the speeds of the rover.
        speed_rows = np.array([t @ J[:3], side @ J[:3], -N @ J[:3], r * frame.axle @ J[3:]])
        speeds = speed_rows @ self.state.v
        constants = [mount.wheel, self.model.soils[patch.facet.ground]]
        contact = np.array([patch.h, *speeds, frame.centre[0], mount.axle, *laws.numbers(constants)])
        law = self.law(contact, self.state.contact[index])

        # Implicit midpoint step of the states, half of which enters the load.
        implicit = np.eye(len(law.rate)) - 0.5 * self.dt * law.rate_by_state
        step = np.linalg.solve(implicit, self.dt * law.rate)
        step_by_speed = np.linalg.solve(implicit, self.dt * law.rate_by_speed)
        load = law.load + 0.5 * law.load_by_state @ step
        by_speed = law.by_speed + 0.5 * law.load_by_state @ step_by_speed

        # Load at the beginning of the step, and the load that is predicted for its end.
        share, tilt, turn = patch.share, patch.tilt, patch.turn
        parts = np.array([share, share, share, turn])
        self.begun[index] += parts * law.load
        self.end[index] += parts * (2.0 * load - law.load)
        self.end_slope[index] += parts[:, None] * (by_speed @ speed_rows)

        # Wrench at the wheel's centre for a unit of f_t, f_y, f_n and torque. The law gives the moment about the axle
        # itself, so that only the parts across the axle are taken from the lever arms.
        in_plane = patch.facet.in_plane
        arm = -r * (in_plane[0] * frame.forward + in_plane[1] * frame.up)
        edge = patch.side * np.array([0.0, 1.0, 0.0])
        forces = np.array([share * t + tilt * N, share * side, share * N - tilt * t + edge, np.zeros(3)])
        off_axle = np.eye(3) - np.outer(frame.axle, frame.axle)
        lever = [np.zeros(3), share * np.cross(arm, side), share * np.cross(arm, N) + np.cross(arm, edge)]
        moments = np.array([*(off_axle @ moment for moment in lever), -turn * frame.axle])
        push = forces @ J[:3] + moments @ J[3:]
        self.soil_Q += push.T @ load
        self.soil_D += push.T @ by_speed @ speed_rows
        wrench = np.concatenate([forces.T, moments.T])
        self.loads[index] += wrench @ load
        self.load_slopes[index] += wrench @ by_speed @ speed_rows

        # Records: forces add over the patches; slip and travel are weighted by the normal force.
        weight = max(share * load[2], 1e-12)
        f_t, f_y, f_n, torque = parts * load
        self.record[index, [SLIP, SLIP_Y]] += weight * law.slip
        self.record[index, NORMAL] += f_n
        self.record[index, TANGENTIAL] += f_t
        self.record[index, LATERAL] += f_y + patch.side * side[1] * load[2]
        self.record[index, SOIL_TORQUE] += torque
        self.record[index, TRAVEL] += weight * float(velocity @ t)
        return weight, step, step_by_speed @ speed_rows

    def _motors(self) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
        """Return three results for the motors in this step: their torques and the derivatives of the torques by the
        speeds, both (nv,), and for each motor the change of its states as a constant (states,) and its derivative by
        the wheel's speed (states,).
        """
        nv, nx = self.pin_model.nv, self.state.motor.shape[1]
        torque, slope, steps = np.zeros(nv), np.zeros(nv), []
        for index, wheel in enumerate(self.rover.wheels):
            states = self.state.motor[index]
            inputs = np.array([self.duty[index], self.state.v[wheel.dof], index, self.bus])
            out = self.motor(inputs, states, self.motor_parameters)
            # Output: torque, its slope, current, supply voltage, then the blocks of the states.
            rate, rate_slope, by_state = np.split(out[4 : 4 + 3 * nx], 3)
            implicit = np.eye(nx) - 0.5 * self.dt * out[4 + 3 * nx :].reshape((nx, nx), order="F")
            gain = np.linalg.solve(implicit, self.dt * rate)
            gain_slope = np.linalg.solve(implicit, self.dt * rate_slope)
            torque[wheel.dof] = out[0] + 0.5 * by_state @ gain
            slope[wheel.dof] = out[1] + 0.5 * by_state @ gain_slope
            steps.append((gain, gain_slope))
            self.record[index, [TORQUE, CURRENT, SUPPLY]] = torque[wheel.dof], out[2], out[3]
        if self.held_rate is not None:
            # (M + J) du = J (rate - v) with an inertia J so large that M hardly counts.
            for wheel, rate in zip(self.rover.wheels, self.held_rate, strict=True):
                hold_gain = HOLDING_INERTIA * self.rover.mass * float(wheel.wheel.r) ** 2 / (GAMMA * self.dt)
                torque[wheel.dof] = hold_gain * (rate - self.state.v[wheel.dof])
                slope[wheel.dof] = -hold_gain
        return torque, slope, steps

    def _springs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the torques of the steering servos and of the end stops, and their derivatives by the speeds, both
        (nv,).

        Servos and end stops are stiff springs with dampers. Their torque is taken at the end of the step, which keeps
        the step stable.
        """
        model, state = self.pin_model, self.state
        # Gains are those of Nexus 6, scaled with the rover's mass and wheels.
        force, slope = np.zeros(model.nv), np.zeros(model.nv)
        q_of = {model.joints[j].idx_v: model.joints[j].idx_q for j in range(2, model.njoints)}
        strength = joint_strength(self.model.rover)

        def spring(dof: int, over: float, base_gains: tuple[float, float]) -> None:
            gains = strength * base_gains[0], strength * base_gains[1]
            force[dof] = -gains[0] * (over + 0.5 * self.dt * state.v[dof]) - gains[1] * state.v[dof]
            slope[dof] = -0.5 * gains[0] * self.dt - gains[1]

        for target, dof in zip(self.servo_target, self.servo_dofs, strict=False):
            spring(dof, state.q[q_of[dof]] - target, SERVO_GAIN)
        for dof in suspension_dofs(self.rover):
            angle = state.q[q_of[dof]]
            over = angle - np.clip(angle, model.lowerPositionLimit[q_of[dof]], model.upperPositionLimit[q_of[dof]])
            if over != 0.0:
                spring(dof, over, STOP_GAIN)
            # A joint that leaves its stop faster than the damper allows is not pulled back.
            if force[dof] * over > 0.0:
                force[dof] = slope[dof] = 0.0
        return force, slope

    def _push(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the generalised force of the body effects (nv,) and its derivatives by the speeds (nv, nv). The torque
        of the differential and its derivatives are stored in the stepper.
        """
        state, nv = self.state, self.pin_model.nv
        joints, places = suspension_dofs(self.rover), suspension_places(self.rover)
        # Body effects push the base (6) and the joints of the suspension.
        m, dofs = 6 + len(joints), [*range(6), *joints]
        inputs = np.concatenate([state.q[:7], state.v[:6], state.q[places], state.v[joints], [0.5 * self.dt]])
        out = self.body(inputs, np.zeros(0), laws.numbers(self.model.body_effects))
        force, slope, self.torque_slope = np.zeros(nv), np.zeros((nv, nv)), np.zeros(nv)
        # Output: Q, D by columns, the differential's torque, its slopes.
        force[dofs], slope[np.ix_(dofs, dofs)] = out[:m], out[m : m + m * m].reshape((m, m), order="F")
        self.torque, self.torque_slope[dofs] = float(out[m + m * m]), out[m + m * m + 1 :]
        return force, slope
