"""Real pictures of cameras with five and ten heads, in flight.

`solved` makes a rig of the pictures' metadata and turns its heads by tie points; `printed` has what
an independent trial found. `pairs`, `rotations`, `relatives`, `parallax` and `vignetting` are the
tables of the chapter on ten real heads, `figures`, `sentences` and `exercises` its parts.
"""
