"""What the chapters show: a file or a folder for every notebook, in the order of the book.

`flight` (section 3.2), `heads` (2.1 and 4.1), `synthetic_image` (2.1), `mounting` (2.2 and 4.2) and
`validation` (4.3) are the paper's; `rig`, `weights`, `image_quality`, `synthetic_cost`, `failures`,
`design`, `error_budget`, `stability` and `from_pictures` ask what it leaves open. Each has figures,
and what several cells need. What a chapter computes for the results folder is a stage of
`acx4lib.stages`. Begin with the notebook.
"""
