"""The notebooks run with parameters, stage after stage (``acx4 run``).

`runner` knows which notebook is which stage of the paper, which of them a flight has data for, and
moves results in place when a notebook has run to its end. `execute` runs one of them, in an
`interpreter` of its own. `inputs` says what the outcome of one depends on.
"""
