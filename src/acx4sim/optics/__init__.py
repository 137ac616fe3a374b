"""How light goes: the lens, refraction in the air, and heads that give the paper's Table 1.

`lens` is a camera with its own distortion solver, `air` Snell's law over level layers, and
`head_truth` the interior orientation that the four heads truly have.
"""
