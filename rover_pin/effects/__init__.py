"""Everything that pushes on the rover besides its motors: one effect a file, the paper's own traction included."""
