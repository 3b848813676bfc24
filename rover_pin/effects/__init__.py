"""See ARCHITECTURE in README: the effects room."""
