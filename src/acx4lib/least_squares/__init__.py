"""Least squares that know no camera.

`adjustment` is Gauss-Newton on any problem that gives normal equations. `normal_equations`
assembles them the plain way and eliminates points; `dense` and `banded` solve what remains.
`statistics` has what residuals say, with Baarda's test of single observations, `datum` what the
observations leave open, `gauss_markov` errors that change slowly, `covariance` how they propagate.
`processors` shares work where linear algebra leaves them free. The paper takes all this as known.
Begin with `adjustment`.
"""
