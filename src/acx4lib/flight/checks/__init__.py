"""What can be wrong with a flight, and what it looks like when it is.

`settings` and `between_tables` find what contradicts itself, with the checks of any table in
`values`. `fit` intersects rays, holds them against control points, and lets `mistakes` try the
usual errors of signs, orders and units. `readings` are the meanings that numbers may have.
`oddities` become notes only.
"""
