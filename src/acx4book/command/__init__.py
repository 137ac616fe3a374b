"""The command ``acx4``: arguments, progress, what is said, exit status.

`acx4` has simulate, check, run and report, `render` the images, `teaching` lab and grade;
`many` flights are run in `batch`. `endings` turns errors into a sentence and a status, and
`terminal` is what all commands share. Begin with `acx4`.
"""
