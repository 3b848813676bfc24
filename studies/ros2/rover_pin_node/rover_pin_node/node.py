"""A rover on its soil in real time: the node reads `cmd_vel` and publishes `joint_states`, `odom` and `wheel_slip`.

Every control period of the clock (0.05 s) the compiled drive advances by the same time. The wheels hold the rates that
the rover's kinematics give for the last command, and stop if no command arrives for `cmd_vel_timeout`. `odom` is the
true pose, with the twist in `base_link`. `joint_states` has the names of the URDF; the effort of a wheel is its motor's
torque. `wheel_slip` has one number for each wheel, in the order of its label.
"""

import math

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from rover_pin import scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.control.motion.servo import HeldSpeeds

DEPTH = 10
"""Number of messages that a topic keeps for a slow reader."""


class RoverNode(Node):
    """A scenario's rover; parameters `scenario`, `rover`, `soil` (empty: the scenario's), `cmd_vel_timeout` [s]."""

    def __init__(self):
        super().__init__("rover_pin")
        settings = {name: self.declare_parameter(name, default).value
                 for name, default in (("scenario", "flat"), ("rover", "nexus6"), ("soil", ""))}  # fmt: skip
        self.timeout = self.declare_parameter("cmd_vel_timeout", 0.5).value
        # Empty parameters leave the choice to the scenario.
        name, overrides = settings.pop("scenario"), {name: value for name, value in settings.items() if value}
        # The rover is at rest until the first command arrives.
        chosen = scenario(name, control="cmd-vel", **{"control.speed": 0.0, **overrides})
        self.model, self.timing, self.place = chosen.model, chosen.timing, chosen.start
        self.control = chosen.controller
        self.heard, self.turned = self.get_clock().now(), np.zeros(self.model.rover.model.njoints)
        self.joints = self.create_publisher(JointState, "joint_states", DEPTH)
        self.odom = self.create_publisher(Odometry, "odom", DEPTH)
        self.slip = self.create_publisher(Float64MultiArray, "wheel_slip", DEPTH)
        self.create_subscription(Twist, "cmd_vel", self.obey, DEPTH)
        self.timer = self.create_timer(self.timing.control, self.go_on)

    def obey(self, message):
        """Take the motion that a `cmd_vel` message commands, and hold it until the next message. Sideways motion needs
        wheels that steer.
        """
        x, y = message.linear.x, message.linear.y
        try:
            # A sideways component asks for crabbing in the direction of travel.
            self.hold(math.hypot(x, y) if y else x, message.angular.z, math.atan2(y, x) if y else 0.0)
        except ParameterError as error:
            self.get_logger().warning(f"cmd_vel is not obeyed: {error}")
            return
        self.heard = self.get_clock().now()

    def hold(self, speed, yaw_rate, crab=0.0):
        """Change the held motion. The servos keep their integrals, so that the torque does not jump."""
        before = self.control
        self.control = HeldSpeeds.of(
            self.model.rover, self.model.motor, speed, yaw_rate, crab, before.track, before.servo, before.limit
        )
        self.control.memory[:] = before.memory

    def go_on(self):
        """Advance the drive by one control period and publish the new state."""
        # A lost connection must stop the rover.
        if (self.get_clock().now() - self.heard).nanoseconds > 1e9 * self.timeout:
            self.hold(0.0, 0.0)
        trace = simulate(self.model, self.control, self.timing.control, self.place, self.timing, measure_error=False)
        # A drive that ends early, for example because a wheel is buried, cannot continue.
        if trace.attrs["stop"] != "duration":
            self.get_logger().error(f"the drive is over: {trace.attrs['stop']}")
            self.timer.cancel()
            return
        self.place = trace.end
        stamp = self.get_clock().now().to_msg()
        self.joints.publish(self.joint_states(trace, stamp))
        self.odom.publish(self.odometry(stamp))
        label = " ".join(trace.wheels)
        # One number for each wheel; the label states their order.
        slip = Float64MultiArray(data=trace.stack("slip")[-1].tolist())
        slip.layout.dim = [MultiArrayDimension(label=label, size=len(slip.data), stride=len(slip.data))]
        self.slip.publish(slip)

    def joint_states(self, trace, stamp):
        """Return angles [rad], which continue beyond a turn, rates [rad/s] and torques [N m] of all joints."""
        pin_model, state = self.model.rover.model, self.place.state
        torques = {wheel.joint: trace[f"torque_{wheel.name}"][-1] for wheel in self.model.rover.wheels}
        message = JointState()
        message.header.stamp = stamp
        for number in range(2, pin_model.njoints):
            joint = pin_model.joints[number]
            q = state.q[joint.idx_q : joint.idx_q + joint.nq]
            # Continuous joints are stored as cosine and sine; the angle is unwrapped against the previous one.
            angle = math.atan2(q[1], q[0]) if joint.nq == 2 else q[0]
            self.turned[number] += math.remainder(angle - self.turned[number], 2.0 * math.pi)
            message.name.append(pin_model.names[number])
            message.position.append(float(self.turned[number]))
            message.velocity.append(float(state.v[joint.idx_v]))
            message.effort.append(float(torques.get(number, 0.0)))
        return message

    def odometry(self, stamp):
        """Return the pose of the base in the world, and its speeds in its own axes."""
        message, state = Odometry(), self.place.state
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "odom", "base_link"
        # Position and velocity of the floating base, in the order of Pinocchio's state.
        places = (message.pose.pose.position, message.pose.pose.orientation)
        speeds = (message.twist.twist.linear, message.twist.twist.angular)
        for target, names, values in zip(
            (*places, *speeds), ("xyz", "xyzw", "xyz", "xyz"), (state.q[:3], state.q[3:7], state.v[:3], state.v[3:6]),
            strict=True,
        ):  # fmt: skip
            for name, value in zip(names, values, strict=True):
                setattr(target, name, float(value))
        return message


def main():
    """Run the node until it is stopped."""
    rclpy.init()
    node = RoverNode()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
