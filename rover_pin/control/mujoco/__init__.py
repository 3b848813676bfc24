"""A rover in MuJoCo: its bodies and motors as MJCF (`mjcf`), and the soil under its wheels (`soil_forces`)."""
