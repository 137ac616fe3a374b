"""What PROJ is asked, and what it must not be asked.

`crs_text` tells which texts are a CRS, `geoid` finds the grid of a height system.
"""
