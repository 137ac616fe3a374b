"""A ground to take pictures of: a landscape drawn from noise, or a photograph.

`scenery` asks `country` where lanes, water and villages are, and draws its fields, settlements and
trees with the coloured shapes of `drawing`, which gives every place its own random numbers. A
picture can lie on the ground instead.
"""
