"""Other programs' files in and out.

`safe` reads files of strangers, `trajectories` what says where images were taken, `pictures` the
metadata of pictures. Every file of `programs` returns what its program knows as a `project`, of
which a flight is made in one place, by lenses that are rows of `lens_models`. `outward` takes
calibrations and orientations out. `flight_folder` writes what an import brings, with its
settings. `lens` refits any program's lens into the library's camera, and back; `opencv` is a
case of it. This is the only room that knows conventions that are not the library's own.
"""
