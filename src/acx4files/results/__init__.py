"""A results folder: written, looked up and read back.

`tables` turns adjustments and validations into the tables that `folder` writes, reads and looks up.
`read_back` reads calibrations for later stages, and those of another flight. `provenance` keeps the
flight and the software of every stage; `whole_files` says where a command may write, locks it, and
writes a file whole or not at all. Begin with `folder`.
"""
