"""Export a calibration from results to other programs.

`calibrated` reads it, with the heads of a rig relative to the first one; `orientations` is direct
georeferencing; `brown` has the lens as most programs have it; `taken` is what every kind leaves.
`programs` has the kinds, and the files of each program; `metashape` and `opf` are large ones.
"""
