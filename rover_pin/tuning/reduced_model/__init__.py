"""A longitudinal model of the driving rover, small enough to be differentiated: begin with `drive`."""
