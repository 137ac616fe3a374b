"""Other programs' files in and out.

`safe` reads files of strangers, `trajectories` what says where images were taken, `metadata` that
of a picture, and `pictures` a folder of them. Every file of `programs` returns what its program
knows as a `project`, of which a flight is made in one place; `coordinates` are its axes and its
coordinate system, and `lens` refits any program's lens into the library's camera, and back;
`opencv` is a case of it. `outward` takes calibrations and orientations out. `flight_folder` writes
what an import brings, with its settings. This is the only room that knows conventions that are not
the library's own.
"""
