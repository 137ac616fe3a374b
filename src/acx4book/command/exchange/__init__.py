"""Other programs' files in and out: ``acx4 import``, ``acx4 new``, ``acx4 export``.

What every import does in the same way is in `bring`; a module each has the kinds of one sort.
"""
