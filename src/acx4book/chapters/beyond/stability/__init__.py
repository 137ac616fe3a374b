"""Chapter 18, over the years: whether a camera has changed, and whether a rig is rigid.

`history` has six simulated flights of one camera, `turned` is a rig with one head that turned, and
`figures` has two figures. Begin with the notebook.
"""
