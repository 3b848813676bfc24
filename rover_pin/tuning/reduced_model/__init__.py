"""A longitudinal model of the driving rover, small enough to be driven many times: begin with `drive`."""
