"""Views of a drive: a 3D page for a browser, which needs no network, and an animation.

`film` holds the drive that is shown, with its poses, forces and tracks frame by frame. `triangles` holds the triangles
of the terrain and of the rover. `stage` builds a viser scene from them, `page` writes the scene as an HTML page with
plots and events, and `animation` draws GIF and MP4. `export` writes tables and recordings for other programs.
"""
