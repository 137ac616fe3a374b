"""A results folder: written, looked up and read back.

`rows` and `adjustments` turn adjustments, and `validations` turns Table 4, into the tables that
`folder` writes whole or not at all. `read_back` makes calibrations of them for the stages that
follow, and `carried` the blocks of synthetic images that were measured in heads. `provenance` keeps
what a run was made from, and `own_folder` guards where commands write. `tables` are for programs.
Begin with `folder`, which lists the columns of every table.
"""
