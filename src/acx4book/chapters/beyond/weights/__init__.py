"""Chapter 9, standard deviations: given wrong, estimated, and errors that change slowly.

`study` flies and adjusts many simulated flights; `tables` and `figures` show them. One flight of
each kind stands in the notebook.
"""
