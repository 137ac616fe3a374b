"""Chapter 15: which flight determines what, before it is flown.

`plans` has the paper's, `figures` and `tables` show what flights determine, `explorer` is the
figure that readers move. Begin with the notebook.
"""
