"""A results folder: written, looked up and read back.

`rows` and `adjustments` turn adjustments and Table 4 into the tables that `folder` writes whole or
not at all; `table_files` defines their form. `read_back` reads calibrations
for later stages, `earlier` those of another flight. `provenance` keeps the origin of a run, and
lets a stage write all or nothing; `own_folder` guards the folders of commands, `whole_files` their
files. `tables` are for programs. Begin with `folder`, which writes and reads every table.
"""
