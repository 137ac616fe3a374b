"""Bundle adjustments of DBAT, PhotoModeler and AICON: their files, reports and numbers.

`files` converts DBAT's conventions, `printed` reads every number of a report, `blocks` sets up the
two projects, and `comparison` holds our adjustment against each number.
"""
