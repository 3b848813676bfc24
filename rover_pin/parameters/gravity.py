"""Surface gravity of the places a rover drives on [m/s^2]."""

EARTH = 9.81
"""Standard gravity, rounded as engineering tables do (9.80665)."""
MOON = 1.62
"""NASA Planetary Fact Sheet."""
MARS = 3.71
"""NASA Planetary Fact Sheet (3.73 at the equator, 3.71 as commonly tabulated)."""

GRAVITIES = {"earth": EARTH, "moon": MOON, "mars": MARS}
"""By name, for the command line and files."""
