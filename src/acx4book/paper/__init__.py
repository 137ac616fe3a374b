"""What the paper prints, as printed, and what follows from it.

`printed` reads its tables and statements; `scorecard` holds a run against them; `errata` holds
them against each other. Begin with `printed`.
"""
