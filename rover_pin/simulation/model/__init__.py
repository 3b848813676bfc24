"""The model of a drive: rover, terrain, soils, motors and effects; read from and written to TOML.

Start at `model`. `defaults` contains the assumptions for a rover whose files state no motor or no soil.
"""
