"""Figures and tables of the chapters: a file or a folder for every notebook, in their order.

`flight` (section 3.2), `heads` (2.1 and 4.1), `synthetic_image` (2.1), `mounting` (2.2 and 4.2) and
`validation` (4.3) are the paper's; `rig`, `weights`, `image_quality`, `synthetic_cost`, `failures`,
`design`, `error_budget`, `stability` and `from_pictures` ask further questions. Each has figures,
and functions that several cells share. A chapter's results in the results folder are computed by a
stage of `acx4files.stages`. Begin with the notebook.
"""
