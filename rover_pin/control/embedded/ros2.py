"""A ROS 2 package around the C of a slip control: a controller for ros2_control, with what colcon needs."""

from rover_pin.base.files.paths import text_of_package
from rover_pin.control.embedded.source import Embedded

PACKAGE = """<?xml version="1.0"?>
<package format="3">
  <name>rover_slip_controller</name>
  <version>0.0.1</version>
  <description>Slip control of ROVER, written by rover-pin</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>MIT</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <depend>controller_interface</depend>
  <depend>pluginlib</depend>
  <depend>rclcpp</depend>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
PLUGIN = """<library path="rover_slip_controller">
  <class name="rover_pin/SlipController" type="rover_pin::SlipController"
         base_class_type="controller_interface::ControllerInterface">
    <description>Slip control by what the rover feels on board</description>
  </class>
</library>
"""
BUILD = """cmake_minimum_required(VERSION 3.16)
project(rover_slip_controller C CXX)
set(CMAKE_C_STANDARD 11)
set(CMAKE_CXX_STANDARD 17)
find_package(ament_cmake REQUIRED)
find_package(controller_interface REQUIRED)
find_package(pluginlib REQUIRED)
find_package(rclcpp REQUIRED)
add_library(rover_slip_controller SHARED slip_controller.cpp ../rover_control.c)
target_include_directories(rover_slip_controller PRIVATE ..)
ament_target_dependencies(rover_slip_controller controller_interface pluginlib rclcpp)
pluginlib_export_plugin_description_file(controller_interface plugin.xml)
install(TARGETS rover_slip_controller LIBRARY DESTINATION lib)
ament_package()
"""


def ros2_files(taken: Embedded) -> dict[str, str]:
    """Return name -> text of the package's files; a control that must be given the slip has none."""
    if not taken.reads_sensors_alone:
        return {}
    model, places = taken.rover.model, taken.on_board.places.tolist() if taken.on_board else []
    name_at = {joint.idx_q: name for joint, name in zip(model.joints, model.names, strict=True)}
    texts = {
        "WHEELS": [model.names[wheel.joint] for wheel in taken.rover.wheels],
        "LINKS": [name_at[place] for place in places],
    }
    source = text_of_package("rover_pin.control.embedded", "ros2_controller.cpp")
    for key, words in texts.items():
        source = source.replace(f"@{key}@", ", ".join(f'"{word}"' for word in words))
    return {
        "slip_controller.cpp": source,
        "package.xml": PACKAGE.replace("ROVER", taken.rover.name),
        "plugin.xml": PLUGIN,
        "CMakeLists.txt": BUILD,
    }
