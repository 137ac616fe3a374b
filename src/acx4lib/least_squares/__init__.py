"""Least squares that know no camera.

`adjustment` is Gauss-Newton on any problem that gives normal equations. `normal_equations`
assembles them the plain way and eliminates points; `dense` and `banded` solve what remains.
`statistics` has tests and distributions, with Baarda's test of single observations, `datum` the
motions left open, `gauss_markov` slowly changing errors, `covariance` error propagation.
`processors` shares work between processors. The paper assumes all this known. Begin with
`adjustment`.
"""
