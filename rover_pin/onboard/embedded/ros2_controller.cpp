// A controller of ros2_control that runs the slip control in rover_control.c.
// It reads the states of the joints and of an IMU, and writes the duties of the wheels.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "controller_interface/controller_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"
#include "rover_control.h"

namespace rover_pin {

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;

const std::array<std::string, ROVER_WHEELS> WHEELS = {@WHEELS@};
const std::vector<std::string> LINKS = {@LINKS@};
const std::string IMU = "imu";

class SlipController : public controller_interface::ControllerInterface {
 public:
  CallbackReturn on_init() override { return CallbackReturn::SUCCESS; }

  InterfaceConfiguration command_interface_configuration() const override {
    return {controller_interface::interface_configuration_type::INDIVIDUAL, of_wheels("duty")};
  }

  // The states in the order in which read() takes them: rates [rad/s] and currents [A] of the wheels, angles of the
  // suspension [rad], and the orientation of the base as a quaternion.
  InterfaceConfiguration state_interface_configuration() const override {
    auto names = of_wheels("velocity");
    for (const auto & name : of_wheels("current")) names.push_back(name);
    for (const auto & name : LINKS) names.push_back(name + "/position");
    for (const char * part : {"x", "y", "z", "w"}) names.push_back(IMU + "/orientation." + part);
    return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override {
    rover_control_reset(&control_);
#ifdef ROVER_MONITOR
    rover_monitor_reset(&monitor_);
#endif
    command_ = RoverCommand{};
    begins_ = true;
    return CallbackReturn::SUCCESS;
  }

  // The controller manager calls this at its own rate; the control takes a sample every ROVER_PERIOD.
  controller_interface::return_type update(const rclcpp::Time &, const rclcpp::Duration & period) override {
    // The first call takes a sample at once, whatever the period is.
    left_ = begins_ ? 0.0 : left_ - period.seconds();
    begins_ = false;
    if (left_ > 1e-6 * ROVER_PERIOD) return controller_interface::return_type::OK;
    left_ = std::fmax(left_ + ROVER_PERIOD, 0.0);
    const auto reading = read();
    rover_control_step(&control_, &reading, &command_);
#ifdef ROVER_MONITOR
    const bool alarmed = forecast_.alarm;
    rover_monitor_step(&monitor_, &control_, &reading, &forecast_);
    if (forecast_.alarm && !alarmed) RCLCPP_WARN(get_node()->get_logger(), "The rover will be stuck within seconds, with probability %.2f", forecast_.p_stuck);
#endif
    for (size_t i = 0; i < ROVER_WHEELS; ++i) command_interfaces_[i].set_value(command_.duty[i]);
    return controller_interface::return_type::OK;
  }

 private:
  static std::vector<std::string> of_wheels(const std::string & interface) {
    std::vector<std::string> names;
    for (const auto & wheel : WHEELS) names.push_back(wheel + "/" + interface);
    return names;
  }

  RoverReading read() const {
    RoverReading in{};
    size_t at = 0;
    for (size_t i = 0; i < ROVER_WHEELS; ++i) in.duty[i] = command_.duty[i];
    for (auto & rate : in.wheel_rate) rate = state_interfaces_[at++].get_value();
    for (auto & current : in.current) current = state_interfaces_[at++].get_value();
    for (size_t i = 0; i < LINKS.size(); ++i) in.suspension[i] = state_interfaces_[at++].get_value();
    double q[4];
    for (double & part : q) part = state_interfaces_[at++].get_value();
    // Roll and pitch from the quaternion; the yaw is not used.
    in.roll = std::atan2(2.0 * (q[3] * q[0] + q[1] * q[2]), 1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]));
    in.pitch = std::asin(std::fmin(1.0, std::fmax(-1.0, 2.0 * (q[3] * q[1] - q[2] * q[0]))));
    in.seen_speed = std::nan("");
    return in;
  }

  RoverControl control_{};
  RoverCommand command_{};
  double left_ = 0.0; // time until the next sample [s]
  bool begins_ = true;
#ifdef ROVER_MONITOR
  RoverMonitor monitor_{};
  RoverForecast forecast_{};
#endif
};

}  // namespace rover_pin

PLUGINLIB_EXPORT_CLASS(rover_pin::SlipController, controller_interface::ControllerInterface)
