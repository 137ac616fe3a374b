"""A calibration taken out of results, for other programs.

`calibrated` reads it, `relative` has the heads of a rig relative to the first one, `orientations`
direct georeferencing; `taken` is what every kind leaves. The kinds themselves are `kinds`, the
small ones here, those of programs that are also read in `programs`.
"""
