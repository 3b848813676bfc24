"""What everything else stands on, with no rover in it: errors, quantities with units, arguments, settings, trust.

Start at `errors` and `quantity`. `files` reads and writes tables and TOML within bounds; `jobs` runs workers.
"""
