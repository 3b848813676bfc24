"""Export to MuJoCo: the rover as an MJCF file (`mjcf`), and the forces of the soil on its wheels (`soil_forces`)."""
