"""The synthetic images of a whole flight, from files to files (section 2.1, Figure 5).

`flight_images` goes through the exposures. `head_images` and `image_files` read and check the
pictures of the heads, and `exposure` renders one exposure stripe by stripe into a `tiff` with its
pyramid of overviews. Begin with `flight_images`, then
`exposure`.
"""
