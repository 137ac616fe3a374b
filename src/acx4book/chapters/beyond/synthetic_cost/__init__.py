"""Chapter 12, what the synthetic image costs: the same measurements with it and without it.

`study` reads what ``make chain`` left and sums it up over flights; `heights` follows the residual
pattern to other flying heights, `lever_arm` is the closed form of the lever arm's height, `radial`
the distortion over the focal length and over the distance of the lens centres; `tables`,
`figures`, `figure_pattern` and `sentences` show them.
"""
