"""Comparison of campaigns as a page and tables, the output of ``acx4 compare``.

`tables` and `figures` show a comparison, or the heads of one flight, in units for readers;
`written` makes the page and the folder. Begin with `tables`.
"""
