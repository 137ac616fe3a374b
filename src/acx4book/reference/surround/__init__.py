"""A car's four fisheye cameras: the same task with another geometry (chapter 11).

As heads are projected into the plane of the synthetic image, so are these cameras into the
ground. An image is resampled once, from where it was taken. Grey values of even ground tell the
cameras' gains; corners of the printed target tell how far apart their views are, and which
changes of the cameras make them fit. Begin with `cameras`.
"""
