"""Least squares that know no camera.

`adjustment` is Gauss-Newton on any problem that gives normal equations. `normal_equations`
assembles them the plain way and eliminates points; `reduced_system` solves what remains.
`statistics` has tests and distributions, with Baarda's test of single observations, `covariance`
error propagation and slowly changing errors. `processors` shares work between processors. The
paper assumes all this known. Begin with `adjustment`.
"""
