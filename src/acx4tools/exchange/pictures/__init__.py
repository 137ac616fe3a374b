"""A flight from pictures alone: what their EXIF and XMP say of cameras, mountings and exposures.

`tags` reads the metadata of a TIFF or JPEG, `lens` makes a camera of them. `folder` puts the
pictures of a folder together to a flight. Begin there.
"""
