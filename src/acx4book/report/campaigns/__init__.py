"""Campaigns compared, as one page and as tables: what ``acx4 compare`` leaves.

`tables` and `figures` show a comparison, or the heads of one flight, in units for readers;
`written` makes the page and the folder. Begin with `tables`.
"""
