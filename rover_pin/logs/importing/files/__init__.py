"""Files of recordings as tables: text, Parquet, MATLAB, ROS bags."""

from __future__ import annotations
