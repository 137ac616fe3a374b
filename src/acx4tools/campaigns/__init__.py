"""Results of several campaigns compared, to say whether a camera has changed.

A campaign is what one results folder says of the cameras: parameters with their joint covariance,
a date, a temperature; a constant or a line is fitted to several of them. `comparison` has them,
their differences, what is common to all, joint tests, and what a difference moves on the ground.
`tables` are for programs. Begin with `comparison`.
"""
