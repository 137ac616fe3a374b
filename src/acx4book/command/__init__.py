"""The command ``acx4``: arguments, progress, what is said, exit status.

`start` loads `acx4`, which puts the commands together, and has check and report. `run` is of one
flight, or of `many` in `batch`; `compare`, `teaching`, `planning`, `pictures` and the folder
`exchange` have the others. `endings` turns errors into a sentence and a status, and `terminal` is
what all commands share. Begin with `acx4`.
"""
