"""Pages on what long runs left in ``data/benchmarks``.

`speed` of commands, adjustment and rendering, and what imports said of other programs' files;
`sigma` and `verdicts`, whether errors keep to their standard deviations, and reports to theirs.
"""
