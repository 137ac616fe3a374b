"""Pages on what long runs left in ``data/benchmarks``, read by `stored`.

`speed` of commands, adjustment and rendering; `imports`, what they said of other programs' files;
`coverage`, whether errors keep to their standard deviations.
"""
