"""Pages on what long runs left in ``data/benchmarks``, read by `stored`.

`speed` of the adjustment; `rendering` with its `rendering_goals`; `sigma`, whether errors keep to
their standard deviations, by `sigma_tests`; and `bias`, what they leave in the mean.
"""
