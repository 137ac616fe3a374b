"""Chapter 9, standard deviations: given wrong, estimated, and errors that change slowly.

`simulated` and `shifted` fly and adjust simulated flights, `tables` and `figures` show them.
"""
