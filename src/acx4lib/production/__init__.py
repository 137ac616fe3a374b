"""The synthetic images of a whole flight, from files to files.

Pictures of the heads are read and checked, an exposure is rendered stripe by stripe into a TIFF
with overviews, one after the other, on several processes or on a cluster. Begin with
`flight_images`, then `exposure`.
"""
