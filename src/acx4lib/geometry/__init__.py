"""Frames, the camera and the image equations.

Rotations and poses (eq. 6), pixels and lens distortion (eqs 1-2, 7-11), collinearity and a camera
mounted on an observed body (eqs 3-5, 14), rays that meet, and the way from a grid's coordinates
to the mapping frame. Every convention of axes and signs has its one place here. Begin with
`frames`, then `camera` and `collinearity`.
"""
