"""Files of recordings as tables: text, Parquet, MATLAB, ROS bags."""
