"""Pixels sampled and blended, compiled: what `rendering` asks for.

`resampling` goes through the rows, all bands of a pixel at a time by `interpolation`, with the
weights of the heads from `blend_weights`.
"""
