"""Other programs' projects: cameras, images, measurements, control and orientations.

A file for each program: `project` returns what it knows, `read` the flight that is made of it.
"""
