"""See ARCHITECTURE in README: the control room."""
