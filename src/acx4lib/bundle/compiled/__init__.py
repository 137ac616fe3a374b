"""The normal equations of a network, compiled: the twin of `least_squares.normal_equations`.

In the order of a ray: `packing`, `rays`, `elimination`, `chain_rule`, `normals`.
`small_products` are their loops over blocks of a few rows.
"""
