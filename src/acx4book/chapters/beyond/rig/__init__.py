"""Chapter 8, all heads with their trajectory in one adjustment.

`figures` set the heads one by one beside the rig; `deformations` and `truth` say what their errors
do to the synthetic image.
"""
