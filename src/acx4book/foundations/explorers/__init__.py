"""Figures of part I that the reader moves, a module for each.

What they show is computed by the library: derivatives, or a covariance at every stop of a slider.
"""
