"""COLMAP: its lens models, and its models as text and as binary files, with rigs and frames.

Read by own code: both forms are documented and short, while `pycolmap` is a large compiled
library; the tests hold every lens model and both forms against it.
"""
