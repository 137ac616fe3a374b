"""Chapter 2, the synthetic image: tie points, refinement, pixels (section 2.1, Table 2).

`figures` draws its geometry, its seams and the heads' responses, `pictures` its pixels and those of
the heads; `tables` has the numbers.
"""
