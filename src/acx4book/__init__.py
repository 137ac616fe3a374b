"""The paper, recomputed: its chapters, comparisons, report, pages and commands.

`paper` is what was printed; `chapters` has the figures of every notebook; `reference` holds other
people's measurements against us; `report` is the calibration report; `pages` fills the book;
`notebooks` runs what `typesetting` makes readable; `command` is ``acx4``.
"""
