"""The files of a results folder: `table_files` with their columns, and the `summary_entries`.

Only `results.folder` reads and writes them.
"""
