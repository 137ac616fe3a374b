"""From pictures to measurements: the image points of a flight that has pictures only.

A picture is laid onto the ground by its approximate orientation, and from there into another
picture, by `views`: so patches of opposite and crossing strips and of other flying heights are
compared in one geometry. Where the trajectory does not tell well enough what pictures show,
`orientation` finds out by features. `pairs` matches two pictures, `oriented` joins pairs to points
of many rays and adjusts them with the library's bundle, and `levels` goes so from small pictures to
large ones. `targets` are control and check points. `measure` reads a flight without measurements
and writes the measured one. Begin there, then `levels`.
"""
