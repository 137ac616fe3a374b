"""A simulated flight as a folder: its tables, its flight.toml, and its truth beside it.

`flights` flies a plan and measures; `csv_files` and `toml_files` are the text of it, which `writer`
writes whole or not at all.
"""
