"""See ARCHITECTURE in README: the soil room."""
