"""Compiled versions of what a plain one would do row by row: numbers and rows of tables as text.

`lines` writes the lines of a table with the shortest digits of each number. Only
`results.table_files` calls it; Python's ``repr`` and its module csv write the same.
"""
