"""Chapter 3, the mounting: interior orientation, boresight, lever arm (section 4.2, Table 3).

`figures` and `tables` show the stage `mounting`: its parameters, and how well the block determines
and controls them. `held` is an explorer of the two-step method with other lever arms.
"""
