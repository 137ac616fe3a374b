"""The paper, recomputed: its chapters, comparisons, report, pages and commands.

`paper` is what was printed; `chapters` has a folder for every notebook; `reference` holds other
people's measurements against us; `report` is the calibration report; `command` is ``acx4``.
"""
