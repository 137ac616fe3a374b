"""A calibration taken out of results, for other programs.

`calibrated` reads it, with the heads of a rig relative to the first one; `orientations` is direct
georeferencing; `brown` has the lens as most programs have it; `taken` is what every kind leaves.
The kinds are `kinds`, the files of each program in a module of its name.
"""
