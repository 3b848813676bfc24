"""Read recorded files as tables of numbers: text, Parquet, MATLAB, ROS bags, MCAP, and lines of JSON."""
