"""Least squares that know no camera.

Gauss-Newton on any problem that gives normal equations, the plain way to assemble and solve them,
dense or banded, covariances propagated, and Baarda's w-test. It is tested on certified regression
problems. Begin with `adjustment`.
"""
