"""Chapter 19, from pictures to a boresight: pixels, tie points, control, and the camera.

`whole` has the flight of which nothing is measured; `exact` compares measurements with the
simulator's geometry; `figures` and `tables` show both. Begin with `whole`.
"""
