"""Campaigns compared, as one page and as tables: what ``acx4 compare`` leaves.

`study` has what is shown; `tables`, `figures` and `sentences` show it, with `units` for readers;
`rig` is for the heads of one flight; `page` makes the file, `written` the folder. Begin with
`study`.
"""
