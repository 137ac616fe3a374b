"""Pages on the results of long runs in ``data/benchmarks``, read by `stored`.

`speed` of commands, adjustment and rendering, and the messages of imports; `sigma`, errors over
their standard deviations; `verdicts`, reports on good and spoilt flights.
"""
