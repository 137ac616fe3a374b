"""The command ``acx4``: arguments, progress, messages, exit status.

`start` loads `acx4`, which puts the commands together, and has check and report. `run` runs one
flight, or many by `runs` on `processes`; `importing` and `export` exchange data with other
programs; `new`, `pictures`, `planning`, `results` and `teaching` have the other commands.
`endings` turns errors into a sentence and a status, and `terminal` has the common parts of all
commands. Begin with `acx4`.
"""
