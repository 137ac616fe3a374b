"""What can be wrong with a flight, and what it looks like when it is.

`settings` and `between_tables` say what contradicts itself; `fit` intersects rays and holds them
against control points; `mistakes` tries the usual ones; `oddities` only become notes.
"""
