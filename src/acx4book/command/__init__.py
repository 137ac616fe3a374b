"""The command ``acx4``: arguments, progress, messages, exit status.

`start` loads `acx4`, which puts the commands together, and has check and report. `run` runs one
flight, or many by `runs`; `importing` takes data from other programs; `pictures`,
`planning`, `results` and `teaching` have the other commands. `terminal` has the common parts of all
commands, and turns errors into a sentence and a status. Begin with `acx4`.
"""
