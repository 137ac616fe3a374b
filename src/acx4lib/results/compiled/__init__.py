"""Compiled versions of what a plain one would do row by row: numbers and rows of tables as text.

`digits` finds the shortest digits of a number, `lines` writes the lines of a table. Only
`results.table_files` calls them; Python's ``repr`` and its module csv write the same.
"""
