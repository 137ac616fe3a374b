"""Least squares that know no camera.

`adjustment` is Gauss-Newton on any problem that gives normal equations. `normal_equations`
assembles them the plain way and eliminates points; `dense` and `banded` solve what remains.
`covariance` propagates covariance matrices, and `w_test` is Baarda's test of single observations.
`processors` shares work where linear algebra
leaves them free. The paper takes all this as known. Begin with `adjustment`.
"""
