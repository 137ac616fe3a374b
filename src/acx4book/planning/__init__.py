"""Predict the accuracy of a flight from its plan alone, without measurements or drawn errors.

A covariance needs derivatives and standard deviations, no measurement. `plan` is the value, read
from a TOML file, checked and written. `flown` lets the simulator fly it, with errors or without.
`design` adjusts the blocks without errors as section 2.2 does, with sigma0 = 1, in one wind or
several. `tables` are for files and the screen. Begin with `design.of`.
"""
