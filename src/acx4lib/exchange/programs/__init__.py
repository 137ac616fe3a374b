"""Other programs' projects: cameras, images, measurements, control and orientations.

A folder for each program: `lens` has its camera model, `reading` its files. What all of them do in
the same way is in `shared`.
"""
