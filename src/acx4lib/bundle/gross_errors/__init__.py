"""Observations that do not belong: found by data snooping, and taken out of a block.

`data_snooping` adjusts, tests and rejects until nothing is significant; `rejections` are what was
taken out; `limits` say where so many are no single errors; `single_tests` are the tests of all
observations; `absurd_control` finds points surveyed nowhere near where they were measured.
"""
