"""A results folder: written, looked up and read back.

`rows` and `adjustments` turn what was computed into the tables that `folder` writes whole or not
at all; `read_back` makes calibrations of them for the stages that follow. Begin with `folder`.
"""
