"""One image out of four (section 2.1, Table 2, Figure 5).

`frame` has the geometry: the heads' footprints in the synthetic frame. `transferred_points` are
measured in the heads. `head_map` tells where each head sees a pixel, by the collinearity
equations; `response` makes the heads equally bright, from grey values of their overlaps;
`rendering` interpolates, equalises and blends. Begin with `frame`, then `rendering`.
"""
