"""A rover on loose soil as a ROS 2 node. Start at `node`."""
