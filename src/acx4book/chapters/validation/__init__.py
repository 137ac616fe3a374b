"""Chapter 4, direct georeferencing on an independent block (section 4.3, Table 4).

`tables`, `sentences` and `figures` show the stage `validation`; `forgotten_steps` is a trial: one
step of direct georeferencing left out.
"""
