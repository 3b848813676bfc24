"""A drive in 3D: one page that needs no network, or served live; and as a moving picture.

`subject` reads what is to be seen, `film` turns it into poses, colours, arrows and tracks over time, `ground` and
`shapes` are the meshes, `stage` puts them into a viser scene, `page` writes it, with plots and `events` in a `panel`;
`animation` draws GIF and MP4.
"""
