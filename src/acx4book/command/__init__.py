"""The command ``acx4``: arguments, progress, what is said, exit status."""
