"""The step in plain NumPy and Pinocchio: slow, readable, and the reference of the compiled kernel.

One step of Eq (8), second order: half a step of the configuration, the velocities by a Rosenbrock method with the
forces there, the other half. With u the velocities, x the effects' own states, Q(u, x) the soil's generalised force and
tau(u) the motors',

    q <- q (+) dt/2 u,    F = Q + tau - nle,    D = dQ/du + dQ/dx dx/du + dtau/du,    gamma = 1 - 1/sqrt(2),
    (M - gamma dt D) k_1 = dt F + G^T lambda_1,    (M - gamma dt D) k_2 = M k_1 + G^T lambda_2,
    du = gamma k_1 + (1 - gamma) k_2,    G (u + du) = 0,    u <- u + du,    q <- q (+) dt/2 u.

With z = dt M^-1 D it leaves (1 + (1 - 2 gamma) z) / (1 - gamma z)^2 of what decays: exp(z) to second order, and nothing
of what is far faster than the step (L-stable); by the midpoint rule motors would ring until the next command. The mean
force of the step is F + D w, w = gamma (k_1 + (1 - gamma) k_2) in place of du/2. The states' own step
dx = (I - dt/2 r_x)^-1 dt (r + r_u w), r = dx/dt, enters Q with one half. Steering servos, end stops and what pushes the
body are taken fully implicitly: their slopes times dt are in M. Forces that change with u are thus stiffly stable,
those of the soil that change with q (a spring of some 2 kN/m a wheel) are explicit.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II (1996), sections IV.6 and IV.7.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from rover_pin.contact import Load
from rover_pin.rover.constraints import constraint_rows
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.body_law import body_law
from rover_pin.simulation.compiled.kernel import HOLDING
from rover_pin.simulation.compiled.rover_numbers import SERVO_GAIN, STOP_GAIN, model_with_armature
from rover_pin.simulation.compiled.suspension import joint_strength, joints_of, suspension_dofs, suspension_places
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import ENERGY, GAMMA, RECORD
from rover_pin.simulation.pace import growth
from rover_pin.simulation.plain.law import LawValue, PlainLaw
from rover_pin.simulation.state import DriveState
from rover_pin.terrain.section import Facet, Patch, WheelFrame, patches, wheel_frame


class Plain:
    """A model's drive from one step to the next; interface of `Kernel`."""

    def __init__(self, model: Model, state: DriveState, dt: float, symmetric: bool):
        self.model, self.state, self.dt, self.symmetric = model, state, dt, symmetric
        self.rover, self.ground = model.built, model.ground
        self.pin_model = model_with_armature(self.rover, float(model.motor.armature))
        self.data = self.pin_model.createData()
        n = len(self.rover.wheels)
        self.record, self.loads, self.energy = np.zeros((n, len(RECORD))), np.zeros((n, 6)), np.zeros(len(ENERGY))
        self.mean_loads, self.load_slopes = np.zeros((n, 6)), np.zeros((n, 6, self.pin_model.nv))
        self.impulse, self.differential = np.zeros(3), np.zeros(1)
        self.share = model.wheel_share
        self.foreseen, self.misjudged, self.growth, self.pivoted = np.zeros((n, 4)), 0.0, 0.0, 0
        self.duty = np.zeros(n)
        self.held_rate: np.ndarray | None = None
        steered = {i: wheel.steer_dof for i, wheel in enumerate(self.rover.wheels) if wheel.steer_dof is not None}
        self.servo_wheels, self.servo_dofs = list(steered), list(steered.values())
        self.servo_target = np.zeros(max(1, len(self.servo_wheels)))
        self.moving = [state.q, state.v, state.contact, state.motor, self.record, self.loads, self.foreseen]
        self.moving += [self.energy, self.impulse, self.differential]
        self.law = PlainLaw(model)
        self.motor = laws.as_numbers(laws.motor_law(model.motor, model.motor_effects))
        self.body = laws.as_numbers(body_law(model.body_effects, joints_of(self.rover)))
        self.motor_parameters = laws.numbers([model.motor, *model.motor_effects])

    def set_step(self, dt: float) -> None:
        """Let steps have this length [s] from now on."""
        self.dt = dt

    def hold(self, rates: np.ndarray) -> None:
        """Turn the wheels at these rates [rad/s] from now on, whatever that takes; the array may change in place."""
        self.held_rate = rates

    def saved_arrays(self) -> list[np.ndarray]:
        """Return a copy of all that a step changes."""
        return [array.copy() for array in self.moving]

    def restore(self, saved: Sequence[np.ndarray]) -> None:
        """Go back to where `saved_arrays` was taken."""
        for array, value in zip(self.moving, saved, strict=True):
            array[...] = value

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy [J] at the present state."""
        kinetic = pin.computeKineticEnergy(self.pin_model, self.data, self.state.q, self.state.v)
        return kinetic, pin.computePotentialEnergy(self.pin_model, self.data, self.state.q)

    def step(self) -> int:
        """Advance the state by dt; return 0, or 1 when a number is not finite."""
        state, nv, n = self.state, self.pin_model.nv, len(self.rover.wheels)
        state.q[:] = pin.integrate(self.pin_model, state.q, 0.5 * self.dt * state.v)
        pin.computeJointJacobians(self.pin_model, self.data, state.q)
        self.soil_Q, self.soil_D = np.zeros(nv), np.zeros((nv, nv))
        self.bus = float(self.duty @ self.record[:, 10])
        self.record[:], self.loads[:], self.load_slopes[:], self.misjudged = 0.0, 0.0, 0.0, 0.0
        self.begun, self.end, self.end_slope = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4, nv))
        updates = [self._wheel(index) for index in range(n)]
        motor_Q, motor_D, motor_steps = self._motors()
        spring_Q, spring_D = self._springs()
        push_Q, push_D = self._push()
        du, mean_du = self._solve(
            self.soil_Q + motor_Q + spring_Q + push_Q, self.soil_D + np.diag(motor_D), np.diag(spring_D) + push_D
        )
        self.foreseen[:] = self.end + self.end_slope @ du
        self.mean_loads[:] = self.loads + self.load_slopes @ mean_du
        motor = motor_Q + motor_D * mean_du
        if self.held_rate is not None:
            self.record[:, 9] = motor[[wheel.dof for wheel in self.rover.wheels]]
        self._account(du, self.soil_Q + self.soil_D @ mean_du, motor, spring_Q + spring_D * du, push_Q + push_D @ du)
        for index, (gain, slope) in enumerate(updates):
            state.contact[index] += gain + slope @ mean_du
        for wheel, row, (gain, slope) in zip(self.rover.wheels, state.motor, motor_steps, strict=True):
            row += gain + slope * mean_du[wheel.dof]
        state.v += du
        if self.symmetric:
            perm, sign = self.rover.mirror
            state.v[:] = 0.5 * (state.v + np.asarray(sign) * state.v[np.asarray(perm)])
        state.q[:] = pin.integrate(self.pin_model, state.q, 0.5 * self.dt * state.v)
        return 0 if np.all(np.isfinite(state.v)) else 1

    def _solve(self, force: np.ndarray, D: np.ndarray, implicit_D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return du and w; `implicit_D` is the slope of what is taken fully implicitly."""
        model, state = self.pin_model, self.state
        M = pin.crba(model, self.data, state.q)
        mass = np.triu(M) + np.triu(M, 1).T - self.dt * implicit_D
        nle = pin.nonLinearEffects(model, self.data, state.q, state.v)
        effective_mass = mass - GAMMA * self.dt * D
        rigid = self.rover.differential is not None and self.model.rigid_differential
        G = constraint_rows(self.rover, differential=rigid)
        saddle = np.block([[effective_mass, G.T], [G, np.zeros((len(G), len(G)))]])
        first = np.linalg.solve(saddle, np.append(self.dt * (force - nle), -G @ state.v))
        second = np.linalg.solve(saddle, np.append(mass @ first[: model.nv], -G @ state.v))
        solved, mean_du = GAMMA * first + (1.0 - GAMMA) * second, GAMMA * (first + (1.0 - GAMMA) * second)
        du, third = solved[: model.nv], np.linalg.solve(saddle, np.append(mass @ second[: model.nv], -G @ state.v))
        self.growth = growth(*(solution[: model.nv] for solution in (first, second, third)))
        self.differential[0] = -mean_du[model.nv] / GAMMA / self.dt if rigid else self.torque + self.torque_slope @ du
        return np.asarray(du), np.asarray(mean_du[: model.nv])

    def _wheel(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Add a wheel's patches; return how its states move: gain and slope by du."""
        mount = self.rover.wheels[index]
        centre = self.data.oMi[mount.joint].translation.copy()
        J = pin.getJointJacobian(self.pin_model, self.data, mount.joint, pin.LOCAL_WORLD_ALIGNED)
        frame = wheel_frame(centre, J[3:, mount.dof].copy())
        exponents = [float(soil.n) for soil in self.model.soils]
        contacts, sinkage = patches(self.ground, frame, float(mount.wheel.r), float(mount.wheel.b), exponents)
        nx = self.state.contact.shape[1]
        airborne = not contacts
        if airborne and nx:
            contacts = [Patch(1e-9, 0.0, 0.0, 0.0, 0.0, _below(frame))]
        weights, gains, slopes = [], [], []
        for patch in contacts:
            weight, gain, slope = self._patch(index, frame, J, patch)
            weights.append(weight)
            gains.append(weight * gain)
            slopes.append(weight * slope)
        if not weights:
            return np.zeros(nx), np.zeros((nx, J.shape[1]))
        self._judge(index)
        self.record[index, [0, 1, 7]] /= sum(weights)
        self.record[index, 2] = sinkage
        self.record[index, 8] = 0.0 if airborne else len(contacts)
        return np.sum(gains, axis=0) / sum(weights), np.sum(slopes, axis=0) / sum(weights)

    def _patch(
        self, index: int, frame: WheelFrame, J: np.ndarray, patch: Patch
    ) -> tuple[float, np.ndarray, np.ndarray]:
        mount, N = self.rover.wheels[index], patch.facet.normal
        r, velocity = float(mount.wheel.r), J[:3] @ self.state.v
        t = np.cross(frame.axle, N)
        t /= np.linalg.norm(t)
        side = np.cross(N, t)
        see = np.array([t @ J[:3], side @ J[:3], -N @ J[:3], r * frame.axle @ J[3:]])
        speeds = see @ self.state.v
        constants = [mount.wheel, self.model.soils[patch.facet.ground]]
        contact = np.array([patch.h, *speeds, frame.centre[0], mount.axle, *laws.numbers(constants)])
        law = self.law(contact, self.state.contact[index])
        step, step_by_speed = self._state_step(law)
        load = law.load + 0.5 * law.load_by_state @ step
        by_speed = law.by_speed + 0.5 * law.load_by_state @ step_by_speed

        in_plane = patch.facet.in_plane
        arm = -r * (in_plane[0] * frame.forward + in_plane[1] * frame.up)
        share, tilt, turn = patch.share, patch.tilt, patch.turn
        parts = np.array([share, share, share, turn])
        self.begun[index] += parts * law.load
        self.end[index] += parts * (2.0 * load - law.load)
        self.end_slope[index] += parts[:, None] * (by_speed @ see)
        edge = patch.side * np.array([0.0, 1.0, 0.0])
        forces = np.array([share * t + tilt * N, share * side, share * N - tilt * t + edge, np.zeros(3)])
        off_axle = np.eye(3) - np.outer(frame.axle, frame.axle)
        lever = [np.zeros(3), share * np.cross(arm, side), share * np.cross(arm, N) + np.cross(arm, edge)]
        moments = np.array([*(off_axle @ moment for moment in lever), -turn * frame.axle])
        push = forces @ J[:3] + moments @ J[3:]
        self.soil_Q += push.T @ load
        self.soil_D += push.T @ by_speed @ see
        weight = max(share * load[2], 1e-12)
        scaled = Load(*(parts * load))
        self.record[index, :2] += weight * law.slip
        lateral = scaled.f_y + patch.side * side[1] * load[2]
        self.record[index, 3:8] += [scaled.f_n, scaled.f_t, lateral, scaled.torque, weight * float(velocity @ t)]
        wrench = np.concatenate([forces.T, moments.T])
        self.loads[index] += wrench @ load
        self.load_slopes[index] += wrench @ by_speed @ see
        return weight, step, step_by_speed @ see

    def _judge(self, index: int) -> None:
        """Compare a wheel's load, by its normal force, with what the step before took it to become."""
        now, before = self.begun[index], self.foreseen[index]
        if now[2] > 0.0 and before[2] > 0.0:
            off = np.abs(now / now[2] - before / before[2]) / [1.0, 1.0, 1.0, float(self.rover.wheels[index].wheel.r)]
            self.misjudged = max(self.misjudged, float(off.max()) * min(1.0, now[2] / self.share))

    def _state_step(self, law: LawValue) -> tuple[np.ndarray, np.ndarray]:
        implicit = np.eye(len(law.rate)) - 0.5 * self.dt * law.rate_by_state
        return np.linalg.solve(implicit, self.dt * law.rate), np.linalg.solve(implicit, self.dt * law.rate_by_speed)

    def _motors(self) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
        nv, nx = self.pin_model.nv, self.state.motor.shape[1]
        torque, slope, steps = np.zeros(nv), np.zeros(nv), []
        for index, wheel in enumerate(self.rover.wheels):
            states = self.state.motor[index]
            out = self.motor(
                np.array([self.duty[index], self.state.v[wheel.dof], index, self.bus]), states, self.motor_parameters
            )
            rate, rate_slope, by_state = np.split(out[4 : 4 + 3 * nx], 3)
            implicit = np.eye(nx) - 0.5 * self.dt * out[4 + 3 * nx :].reshape((nx, nx), order="F")
            gain = np.linalg.solve(implicit, self.dt * rate)
            gain_slope = np.linalg.solve(implicit, self.dt * rate_slope)
            torque[wheel.dof] = out[0] + 0.5 * by_state @ gain
            slope[wheel.dof] = out[1] + 0.5 * by_state @ gain_slope
            steps.append((gain, gain_slope))
            self.record[index, 9:12] = torque[wheel.dof], out[2], out[3]
        self._hold(torque, slope)
        return torque, slope, steps

    def _hold(self, torque: np.ndarray, slope: np.ndarray) -> None:
        """Hold the wheels to a rate at the step's end: (M + J) du = J (rate - v), J so large that M hardly counts."""
        if self.held_rate is None:
            return
        for wheel, rate in zip(self.rover.wheels, self.held_rate, strict=True):
            gain = HOLDING * self.rover.mass * float(wheel.wheel.r) ** 2 / (GAMMA * self.dt)
            torque[wheel.dof] = gain * (rate - self.state.v[wheel.dof])
            slope[wheel.dof] = -gain

    def _springs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return steering servos and end stops (which push, never pull): stiff springs taken at the end of the step."""
        model, state = self.pin_model, self.state
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
            if force[dof] * over > 0.0:
                force[dof] = slope[dof] = 0.0
        return force, slope

    def _push(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what acts on the body at the end of the step, and its slope; keep the differential's torque."""
        state, nv = self.state, self.pin_model.nv
        joints, places = suspension_dofs(self.rover), suspension_places(self.rover)
        m, at = 6 + len(joints), [*range(6), *joints]
        inputs = np.concatenate([state.q[:7], state.v[:6], state.q[places], state.v[joints], [0.5 * self.dt]])
        out = self.body(inputs, np.zeros(0), laws.numbers(self.model.body_effects))
        force, slope, self.torque_slope = np.zeros(nv), np.zeros((nv, nv)), np.zeros(nv)
        force[at], slope[np.ix_(at, at)] = out[:m], out[m : m + m * m].reshape((m, m), order="F")
        self.torque, self.torque_slope[at] = float(out[m + m * m]), out[m + m * m + 1 :]
        return force, slope

    def _account(
        self, du: np.ndarray, soil: np.ndarray, motor: np.ndarray, springs: np.ndarray, push: np.ndarray
    ) -> None:
        speed = self.state.v + 0.5 * du
        stopped = springs.copy()
        stopped[self.servo_dofs] = 0.0
        electric = float(np.sum(self.record[:, 10] * self.record[:, 11] * self.duty))
        steered = (springs - stopped) @ speed
        self.impulse += self.dt * self.loads[:, :3].sum(axis=0)
        self.energy += self.dt * np.array(
            [motor @ speed, -(soil @ speed), -(stopped @ speed), -steered, electric, -(push @ speed)]
        )


def _below(frame: WheelFrame) -> Facet:
    """Return a facet across the plane of a wheel in the air, for the rates of its states."""
    return Facet(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), frame.up, 0)
