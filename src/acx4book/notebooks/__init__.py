"""The stages of a flight, run with or without notebooks (``acx4 run``).

`runner` knows the order of the stages and which notebook belongs to which, prepares the results
folder, and moves results in place when a stage has run to its end. A stage is run by its function
alone or by its notebook (`execute`, by papermill). `simulated` flies plans. Begin with `runner`.
"""
