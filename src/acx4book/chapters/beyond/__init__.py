"""Chapters beyond the paper: one folder for every notebook.

`rig`, `weights`, `image_quality`, `synthetic_cost`, `failures`, `design`, `error_budget` and
`stability` ask what the paper leaves open. Begin with
`failures`: it needs no other chapter.
"""
