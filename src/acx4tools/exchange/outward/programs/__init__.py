"""Calibrations and orientations in the files of other programs: a module each.

Every module has a function `cameras` for the calibration alone, and `images` where the program has
a place for oriented images as well.
"""
