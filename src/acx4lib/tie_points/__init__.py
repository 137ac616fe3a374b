"""Points that two heads share, and the heads refined by them (section 2.1, Figure 1).

`ties` are tie points measured in the flight's files, with the paper's refinement by mean
differences. `search` finds others in the pixels: in each overlap of two heads, `matching` takes a
corner per cell, correlates it, and fits it by `least_squares_matching`. `refinement` estimates
three rotation angles of each head, and their scatter between exposures. Begin with `ties`, then
`search`.
"""
