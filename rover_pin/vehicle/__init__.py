"""A rover of one's own on the road: what it drives with where its TOML says nothing, and whether it stands and moves.

Start with `defaults` (motor, soil, sizes) and `check`.
"""
