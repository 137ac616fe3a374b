"""Chapter 12, what the synthetic image costs: the same measurements with it and without it.

`study` reads what ``make chain`` left and sums it up over flights; `geometry` is what four lens
centres make of one camera; `tables` and `figures` show them. One flight stands in the notebook.
"""
