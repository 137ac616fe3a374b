"""Pairs of pictures matched by way of the ground.

`views` takes pixels to the `ground` and back, `overlaps` finds the pairs, `corners` covers a
picture evenly, `patches` resamples one picture into another one's pixels, `pairs` matches,
`epipolar` drops what does not lie on a common line, `store` keeps pairs for a command that was
interrupted. Begin with `pairs`.
"""
