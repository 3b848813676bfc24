"""What a rover's URDF and TOML say, and whether a rover can be made of it; nothing here moves yet.

`tree` and `layout` read the two files, `faults` judges them stage by stage, `as_driven` puts joints into the forms that
drives know. Start with `layout.read_layout`.
"""
