"""One image out of four (section 2.1, Table 2).

Where the heads see the synthetic frame, their grey values adjusted to each other, and the
rendering of its pixels. Begin with `frame`; a pixel is interpolated in `rendering`.
"""
