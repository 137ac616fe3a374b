"""Chapter 8, all heads with their trajectory in one adjustment.

`tables` and `figures` show the stage `rig` beside the heads `one_by_one`; `deformations` and
`truth` say what their errors do to the synthetic image.
"""
