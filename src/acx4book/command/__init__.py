"""The command ``acx4``: its arguments, its progress, what it says, its exit status.

`acx4` has the commands and calls what computes; `terminal` writes to the screen; `endings` turns
every failure into one line and a status. Begin with `acx4`.
"""
