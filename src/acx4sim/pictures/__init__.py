"""Pictures of the heads: exact rays to the scenery, light, lens and sensor.

`ground_rays` go from a pixel to the ground and back, `pictures` gives them grey values, and
`photography` takes the pictures of a whole flight.
"""
