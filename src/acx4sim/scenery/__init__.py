"""A ground to take pictures of: a landscape drawn from noise, or a photograph.

`scenery` asks `country` where lanes, water and villages are, and draws them by `fields`,
`settlements` and `trees` with the coloured shapes of `drawing`; `noise` gives every place its own
random numbers. `photo` lays a picture on the ground instead.
"""
