"""The stages of a flight, run one after the other with or without notebooks (``acx4 run``).

`runner` knows the order of the stages and which notebook belongs to which, prepares the results
folder, and moves results in place when a stage has run to its end. A stage is run by its function
alone (`Functions`) or by its notebook (`execute`, in a process of its own, `interpreter`).
`simulated` flies plans. Begin with `runner`.
"""
