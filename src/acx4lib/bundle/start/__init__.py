"""Where an adjustment begins, and how it begins anew.

`start_values` are orientations from few points, `resections` poses where there is no trajectory,
`robust` finds what most observations agree on, and `ray_misfits` tells how far rays pass their
points.
"""
