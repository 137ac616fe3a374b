"""Observations that do not belong: found by data snooping, and taken out of a block.

`data_snooping` adjusts, tests and rejects until nothing is significant; `rejections` are what was
taken out; `absurd_control` finds points that were surveyed nowhere near where they were measured.
"""
