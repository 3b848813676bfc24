"""See ARCHITECTURE in README: the body room."""
