"""What a flight will determine, from its plan alone: nothing is measured, no error is drawn.

A covariance needs derivatives and standard deviations, no measurement. `plan` is the value, `text`
reads it from a TOML file and writes it, `checks` says what is wrong there, and `ground` lays out
the terrain and its points. `exposures` are where the strips expose, `sight` says which images show
which points, and `flown` makes a block of them. `design` has what the adjustments of section 2.2
determine with it: their normal matrices at the values of the plan, with sigma0 = 1; `winds` has the
mean of several winds. `tables` and `shown` are the same for files and for the screen. Begin with
`design.of`.
"""
