// As much of ros2_control as a controller touches, to compile and step one without ROS.
#pragma once
#include <memory>
#include <string>
#include <vector>

namespace rclcpp {
struct Time {};
struct Duration {
  double s;
  double seconds() const { return s; }
};
struct Logger {};
struct Node {
  Logger get_logger() const { return {}; }
};
}  // namespace rclcpp
namespace rclcpp_lifecycle {
struct State {};
}

namespace controller_interface {
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names;
};
struct Handle {
  double *at;
  double get_value() const { return *at; }
  void set_value(double value) { *at = value; }
};
class ControllerInterface {
 public:
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  std::shared_ptr<rclcpp::Node> get_node() const { return std::make_shared<rclcpp::Node>(); }
  std::vector<Handle> command_interfaces_, state_interfaces_;
};
}  // namespace controller_interface
