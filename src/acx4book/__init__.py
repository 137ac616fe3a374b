"""The paper, recomputed: its chapters, comparisons, report, pages and commands.

`paper` has the printed numbers; `chapters` has the figures of every notebook; `reference` compares
other people's measurements with ours; `report` is the calibration report; `pages` fills the book;
`notebooks` runs what `typesetting` makes readable; `command` is ``acx4``.
"""
