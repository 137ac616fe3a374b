"""What `geodesy` asks of PROJ before it trusts it: texts of a CRS, and grids of geoids.

`text` says what is wrong with the text of a CRS, `geoid` opens the grid that heights need.
"""
