"""See ARCHITECTURE in README: the parameters room."""
