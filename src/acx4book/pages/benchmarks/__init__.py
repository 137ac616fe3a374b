"""Pages on what long runs left in ``data/benchmarks``, read by `stored`.

`speed` of the adjustment; `rendering` with its `rendering_goals`; `coverage`, whether errors keep
to their standard deviations.
"""
