"""Results of several campaigns compared, to say whether a camera has changed.

A `campaign` is what one results folder says of the cameras: parameters with their joint covariance,
a date, a temperature. `estimates` fits a constant or a line to several of them; `comparison` has
the differences, what is common to all, and joint tests; `ground` says what a difference moves on
the ground. `tables` are for programs. Begin with `comparison`.
"""
