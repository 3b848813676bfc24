"""See ARCHITECTURE in README: the motion room."""
