"""Predict the accuracy of a flight from its plan alone, without measurements or drawn errors.

A covariance needs derivatives and standard deviations, no measurement. `plan` is the value, read
from a TOML file, checked and written, with its terrain. `flown` exposes the strips, says which
images show which points, and makes a block of them. `design` has what the adjustments of section
2.2 determine with it: their normal matrices at the values of the plan, with sigma0 = 1, in one
wind or several. `tables` are for
files and the screen. Begin with `design.of`.
"""
