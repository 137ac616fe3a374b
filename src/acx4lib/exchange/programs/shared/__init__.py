"""What all readers of projects do in the same way.

`cameras` turns lenses into cameras of flight.toml, `tables` makes the tables, `proof` projects a
program's own points by what was imported, `crs` chooses the flight's coordinate system.
"""
