"""The reduced model of a driving rover, which is fast enough for thousands of drives in a search. Start at `drive`."""
