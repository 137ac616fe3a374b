"""A flight from pictures alone: cameras, mountings and exposures by their EXIF and XMP.

`tags` reads the metadata of a TIFF or JPEG, `lens` makes a camera of them. `folder` puts the
pictures of a folder together to a flight. Begin there.
"""
