"""Chapter 1, the heads: interior and relative orientation (section 4.1, Table 1).

`tables` and `figures` show what notebook 01 computes, also what would be seen if a focal length
were wrong.
"""
