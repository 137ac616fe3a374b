"""Frames, the camera and the image equations (section 2.1, eqs 1-11, and eq. 14).

Rotations and poses are eq. (6); lens distortion is eqs (7)-(11); the collinearity equations
(1)-(5) and eq. (14), a camera mounted on an observed body, are chains of poses. Every convention
of axes and signs has its one place here. Begin with `frames`, then `camera`, `collinearity`,
`intersection`; `geodesy` leads from the coordinates of a map to the mapping frame. `parameters`
has the names of estimated parameters.
"""
