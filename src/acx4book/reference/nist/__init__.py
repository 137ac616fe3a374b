"""Certified `regressions` of NIST: the problems in `files`, our least squares on them."""
