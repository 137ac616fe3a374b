"""A results folder: written, looked up and read back.

`rows` and `adjustments` turn adjustments and Table 4 into the tables that `folder` writes;
`table_files` declares their columns. `read_back` reads calibrations for later stages, `earlier`
those of another flight. `provenance` keeps the flight and the software of every stage;
`own_folder` says where a command may write and locks it, `whole_files` writes a file whole or not
at all. `tables` are for programs. Begin with `folder`, which writes and reads every table.
"""
