"""A results folder: written, looked up and read back.

`rows` and `adjustments` turn adjustments and Table 4 into the tables that `folder` writes whole or
not at all; `table_files` and `summary_entries` have their form. `read_back` makes calibrations of
them for the stages that follow, `earlier` those of another flight. `provenance` keeps what a run
was made from, and lets a stage write all or nothing; `own_folder` guards where commands write, by
`whole_files`. `tables` are for programs. Begin with `folder`, which lists the columns of every
table.
"""
