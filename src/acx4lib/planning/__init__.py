"""What a flight will determine, from its plan alone: nothing is measured, no error is drawn.

A covariance needs derivatives and standard deviations, no measurement. `plan` is the value, `text`
reads it from a TOML file and writes it, `checks` says what is wrong there, and `ground` lays out
the terrain and its points. `flown` has the image points where they would be, and `design` what
the adjustment of section 2.2 determines with them: its normal matrix at the true values, with
sigma0 = 1. `tables` are the same for files. Begin with `design.of`.
"""
