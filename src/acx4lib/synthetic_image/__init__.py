"""One image out of four (section 2.1, Table 2, Figure 5).

`frame` has the geometry: the heads' footprints in the synthetic frame. `carried` takes measured
points from the heads into it. `head_map` tells where each head sees a pixel, by the collinearity
equations; `response` makes the heads equally bright, from the `grey_samples` of their overlaps;
`rendering` interpolates, equalises and blends, and keeps no more of the `mapped_pixels` in memory
than it needs. Begin with `frame`, then `rendering`.
"""
