"""What the chapters show: one folder for every notebook, in the order of the book.

`flight` (section 3.2), `heads` (2.1 and 4.1), `synthetic_image` (2.1), `mounting` (2.2 and 4.2),
`validation` (4.3), and `beyond` the paper. A chapter's folder has its trials, tables, sentences
and figures. What it computes for the results folder is a stage of `acx4lib.stages`. Begin with the
notebook: each of its cells calls one function of a folder here.
"""
