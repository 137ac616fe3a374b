"""A flight from pictures alone: what their EXIF and XMP say of cameras, mountings and exposures.

`tags` reads the metadata of a TIFF or JPEG, `xmp` their XML. `lens` and `fisheye` make a camera of
them, `rig` its mounting among the others, `exposure` when, where and how it was held. `folder` puts
the pictures of a folder together to a flight. Begin there.
"""
