"""The synthetic images of a whole flight, from files to files (section 2.1, Figure 5).

`flight_images` goes through the exposures and renders each stripe by stripe; `head_images` reads
and checks the pictures of the heads, and `tiff` writes an image with its overviews.
"""
