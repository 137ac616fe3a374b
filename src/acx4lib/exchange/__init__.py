"""Other programs' files in and out.

`safe` reads files of strangers, `trajectories` what says where images were taken. `brought` is what
an import brings of a flight, `flight_folder` writes it, and `written_toml` its settings. `opencv`
turns a camera into OpenCV's model, and back. This is the only room that knows conventions that are
not the library's own.
"""
