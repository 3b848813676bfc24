"""What is driven: rover, terrain, motors and effects as one `model`; read from and written to TOML.

Start at `model`; what is assumed where nothing is declared is in `defaults`.
"""
