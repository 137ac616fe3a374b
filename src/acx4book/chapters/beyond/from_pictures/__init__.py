"""Chapter 19, from pictures to a boresight: pixels, tie points, control, and the camera.

`whole` flies, photographs, measures and calibrates; `exact` compares measurements with the
simulator's geometry; `figures`, `tables` and `sentences` show both. `exercises` has the solutions.
Begin with `whole`.
"""
