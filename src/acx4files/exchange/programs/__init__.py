"""Other programs' projects: cameras, images, measurements, control and orientations.

A file for each program: `project` returns the content of its files, `read` the flight from them.
"""
