"""The stages of a flight, run one after the other with or without notebooks (``acx4 run``).

`runner` knows the order of the stages and which notebook belongs to which, prepares the results
folder, and moves results in place when a stage has run to its end. A stage is run by its function
alone (`functions`) or by its notebook (`executed`, one of them by `execute` in an `interpreter` of
its own). `inputs` says what the outcome of a notebook depends on, and `solution` holds what an
exercise finds. Begin with `runner`.
"""
