"""The terrain: its height and soil at every (x, y), ready-made shapes, terrain files, and the contact of a wheel.

`terrain` defines profiles and the two kinds of terrain (`Lanes`, `HeightGrid`), `shapes` makes the terrains of the
scenes, `edits` changes a terrain, `files` and `raster` read terrains from files, and `section` finds where a wheel
touches the terrain.
"""
