"""A slip control to take away: one C file with its header, test vectors and build file, equal to the package's own."""
