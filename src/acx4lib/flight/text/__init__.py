"""The files of a flight as text, in which every value knows its line and column.

`document` is flight.toml; `table_files` reads the tables by their `schemas`, and `rows`,
`headers`, `cells` and `names` say what is wrong with them.
"""
