"""OpenSfM, which ODM and WebODM use: reconstruction.json, camera models, tracks.csv, rigs.

Pixels in these files are normalised: the origin is the middle of the image, the longer side is 1,
x to the right, y down. `lens` has its camera models, `reading` its files.
"""
