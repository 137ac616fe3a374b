"""OPF, the open photogrammetry format of Pix4D, version 1: cameras, rigs, control, orientations.

Source: its specification, https://pix4d.github.io/opf-spec, with Pix4D's pages on internal camera
parameters and on yaw, pitch and roll that it refers to.
"""
