"""The ground floor of the package: errors, quantities with units, settings, text encoding, and consent to run code.

Nothing here depends on a rover. Start at `errors` and `quantity`. `files` reads and writes tables and TOML files with
limits on their size, and `jobs` runs worker processes.
"""
