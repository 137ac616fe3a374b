"""MicMac's files of version 1: orientations, calibrations, measured and surveyed points.

Pixels count from the centre of the top-left one; cameras have x right, y down, z ahead. `lens` has
the distortion models, `reading` the files.
"""
