"""Adjustments small enough to print: one point, the whole example, a camera from single images.

`fitted` is least squares of a linear system. `forward_intersection` has a point of the example,
`whole_system` all of it, `self_calibration` the camera of planned images, and `operations` counts
what the elimination of points saves. Begin with `fitted`.
"""
