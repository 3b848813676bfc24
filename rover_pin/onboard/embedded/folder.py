"""Write the folder of an exported control: C code, test vectors with a test program, build files, and a ROS 2
package.
"""

from pathlib import Path

from rover_pin.base.encode import c_string, csv_cell, xml
from rover_pin.base.files.paths import text_of_package
from rover_pin.base.files.whole_file import replace_file
from rover_pin.control.motion.servo import HeldSpeeds
from rover_pin.onboard.embedded.motion import EmbeddedMotion, embedded_motion
from rover_pin.onboard.embedded.source import EmbeddedControl, embed
from rover_pin.onboard.embedded.vectors import vectors
from rover_pin.onboard.monitor.monitor import CAUSES
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model

VECTORS = 400
"""Number of test vectors in an exported folder, one for each sample; 400 samples are 20 s."""
TOLERANCE, TOLERANCE_ON_BOARD = 1e-12, 1e-6
"""Maximum difference between the results of the C code and the test vectors in double precision, for a control without
and with an on-board slip estimate. With a larger difference, the test fails. The second number is larger, because the
exponential functions of two C libraries differ in the last digit, and the particles of the estimate amplify this
difference: with the belief about unknown sand, a change of the pitch by 1e-16 changes duties by 2e-8."""
MONITOR_COLUMNS = ("p_stuck", "p_buried", "alarm", "cause")
"""Names of the columns in the test vectors that contain the forecasts of the monitor."""
CMAKE = """cmake_minimum_required(VERSION 3.13)
project(rover_control C)
set(CMAKE_C_STANDARD 11)
add_library(rover_control STATIC rover_control.c)
target_include_directories(rover_control PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(rover_control PUBLIC m)
enable_testing()
add_executable(test_vectors test_vectors.c)
target_link_libraries(test_vectors rover_control)
add_test(NAME vectors COMMAND test_vectors ${CMAKE_CURRENT_SOURCE_DIR}/vectors.csv LIMIT)
"""


def control_export(controller: Controller, model: Model) -> EmbeddedControl | EmbeddedMotion:
    """Return the export of a slip control or of held speeds as C, for the rover of a model. `write_control` writes the
    export into a folder.

    Raises ParameterError: the controller is of another kind, or has parts that cannot be exported.
    """
    if isinstance(controller, HeldSpeeds):
        return embedded_motion(controller, model.rover)
    return embed(controller, model)


def write_control(export: EmbeddedControl | EmbeddedMotion, folder: str | Path, count: int = VECTORS) -> list[Path]:
    """Write an exported control with `count` test vectors into a folder, and return the paths of the files.

    Build and test the C code with `cc -std=c11 -Wall -Werror -O2 rover_control.c test_vectors.c -lm && ./a.out
    vectors.csv`, or with CMake.
    """
    place, limit, ros2 = Path(folder), TOLERANCE, dict[str, str]()
    if isinstance(export, EmbeddedMotion):
        program, heads, rows = "motion_vectors.c", export.heads, export.vectors(count)
    else:
        # The columns have the order of the values that `vectors` yields: readings, external slips, results, forecast.
        names = [wheel.name for wheel in export.rover.wheels]
        groups = ("duty", "wheel_rate", "current"), ("slip_given", "travel"), ("duty_out", "slip", "hole")
        before, external, out = ([f"{group}_{name}" for group in row for name in names] for row in groups)
        links = [f"suspension_{i}" for i in range(export.links)]
        ahead = [*MONITOR_COLUMNS, *(f"p_{cause.replace(' ', '_')}" for cause in CAUSES)] if export.monitor else []
        heads = ["anew", *before, *links, "roll", "pitch", "seen_speed", *external, *out, "stands", "stopped", *ahead]
        program, rows = "test_vectors.c", vectors(export, count)
        limit, ros2 = TOLERANCE_ON_BOARD if export.on_board else TOLERANCE, ros2_files(export)
    # Numbers are written by `repr`, from which C reads exactly the same double.
    texts = {
        "rover_control.h": export.header,
        "rover_control.c": export.source,
        "CMakeLists.txt": CMAKE.replace("LIMIT", f"{limit:g}"),
        "test_vectors.c": text_of_package("rover_pin.onboard.embedded", program),
        "vectors.csv": "\n".join([",".join(map(csv_cell, heads)), *(",".join(map(repr, row)) for row in rows), ""]),
        **{f"ros2/{name}": text for name, text in ros2.items()},
        **{f"functions/{function.name()}.casadi": function.serialize() for function in export.expressions},
    }
    (place / "functions").mkdir(parents=True, exist_ok=True)
    return [replace_file(place / name, text) for name, text in texts.items()]


ROS2_PACKAGE = """<?xml version="1.0"?>
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
ROS2_PLUGIN = """<library path="rover_slip_controller">
  <class name="rover_pin/SlipController" type="rover_pin::SlipController"
         base_class_type="controller_interface::ControllerInterface">
    <description>Slip control from measurements on board</description>
  </class>
</library>
"""
ROS2_CMAKE = """cmake_minimum_required(VERSION 3.16)
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


def ros2_files(export: EmbeddedControl) -> dict[str, str]:
    """Return the files of a ROS 2 package for an exported slip control, as texts by the name of the file.

    The package contains a controller for ros2_control. There are no files if the user's program must give slips with
    each reading, because ROS 2 has no interface for slips.
    """
    if not export.reads_sensors_alone:
        return {}
    model, places = export.rover.model, export.on_board.places.tolist() if export.on_board else []
    # Joint and rover names come from the URDF and the TOML, and are encoded for the language of each file.
    name_at = {joint.idx_q: name for joint, name in zip(model.joints, model.names, strict=True)}
    texts = {
        "WHEELS": [model.names[wheel.joint] for wheel in export.rover.wheels],
        "LINKS": [name_at[place] for place in places],
    }
    source = text_of_package("rover_pin.onboard.embedded", "ros2_controller.cpp")
    for key, words in texts.items():
        source = source.replace(f"@{key}@", ", ".join(map(c_string, words)))
    return {
        "slip_controller.cpp": source,
        "package.xml": ROS2_PACKAGE.replace("ROVER", xml(export.rover.name)),
        "plugin.xml": ROS2_PLUGIN,
        "CMakeLists.txt": ROS2_CMAKE,
    }
