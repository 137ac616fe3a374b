"""What a bundle observes besides image points.

`points` are surveyed, `mountings` declared, the `trajectory` is that of GNSS and INS: `strips` has
how it moves along them. How errors that change slowly weigh is in `least_squares.statistical`.
"""
