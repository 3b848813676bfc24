"""A control's files to take away: C, vectors and their test, build files, CasADi's functions, a ROS 2 package."""

from pathlib import Path

from rover_pin.base.files.paths import text_of_package
from rover_pin.base.files.whole_file import replace_file
from rover_pin.control.embedded.motion import EmbeddedMotion, embedded_motion
from rover_pin.control.embedded.source import Embedded, embed
from rover_pin.control.embedded.vectors import vectors
from rover_pin.control.monitor.monitor import CAUSES
from rover_pin.control.motion.servo import HeldSpeeds
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model

COUNT, LIMIT, LIMIT_ON_BOARD = 400, 1e-12, 1e-11
"""Samples of the vectors, 20 s; by how much the C may differ from them in double precision, and the on-board estimate,
whose exponentials are not the same library's."""
AHEAD = ("p_stuck", "p_buried", "alarm", "cause")
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


def taken_away(controller: Controller, model: Model) -> Embedded | EmbeddedMotion:
    """Return a controller of a model's rover as it can be taken away.

    Raises ParameterError: as `embed` and `embedded_motion`.
    """
    if isinstance(controller, HeldSpeeds):
        return embedded_motion(controller, model.rover)
    return embed(controller, model)


def write_control(taken: Embedded | EmbeddedMotion, folder: str | Path, count: int = COUNT) -> list[Path]:
    """Write what is taken away into a folder, and return its files.

    Build and test: `cc -std=c11 -Wall -Werror -O2 rover_control.c test_vectors.c -lm && ./a.out vectors.csv`, or CMake.
    """
    place, limit, ros2 = Path(folder), LIMIT, dict[str, str]()
    if isinstance(taken, EmbeddedMotion):
        program, heads, rows = "motion_vectors.c", taken.heads, taken.vectors(count)
    else:
        program, heads, rows = "test_vectors.c", _heads(taken), vectors(taken, count)
        limit, ros2 = LIMIT_ON_BOARD if taken.on_board else LIMIT, ros2_files(taken)
    texts = {
        "rover_control.h": taken.header,
        "rover_control.c": taken.source,
        "CMakeLists.txt": CMAKE.replace("LIMIT", f"{limit:g}"),
        "test_vectors.c": text_of_package("rover_pin.control.embedded", program),
        "vectors.csv": "\n".join([",".join(heads), *(",".join(map(repr, row)) for row in rows), ""]),
        **{f"ros2/{name}": text for name, text in ros2.items()},
        **{f"functions/{function.name()}.casadi": function.serialize() for function in taken.expressions},
    }
    (place / "functions").mkdir(parents=True, exist_ok=True)
    return [replace_file(place / name, text) for name, text in texts.items()]


def _heads(taken: Embedded) -> list[str]:
    names = [wheel.name for wheel in taken.rover.wheels]
    groups = ("duty", "wheel_rate", "current"), ("slip_given", "travel"), ("duty_out", "slip", "hole")
    before, external, out = ([f"{group}_{name}" for group in row for name in names] for row in groups)
    links = [f"suspension_{at}" for at in range(taken.links)]
    ahead = [*AHEAD, *(f"p_{cause.replace(' ', '_')}" for cause in CAUSES)] if taken.monitor else []
    return ["anew", *before, *links, "roll", "pitch", "seen_speed", *external, *out, "stands", "stopped", *ahead]


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
