"""Export a calibration from results to other programs.

`content` reads it, with the heads of a rig relative to the first one, orients images by it, and
writes the folder of files that every kind leaves; `brown` has the lens as most programs have it;
`programs` has the kinds, and the files of each program.
"""
