"""Chapter 2, the synthetic image: tie points, refinement, pixels (section 2.1, Table 2).

`figures` draws its geometry and the heads' responses, `pictures` and `seams` their pixels; `tables`
has what is counted.
"""
