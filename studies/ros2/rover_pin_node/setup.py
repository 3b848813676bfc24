"""Build description of the ROS 2 package for colcon."""

from setuptools import setup

NAME = "rover_pin_node"

setup(
    name=NAME,
    version="0.0.1",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["rover-pin"],
    entry_points={"console_scripts": [f"node = {NAME}.node:main"]},
)
