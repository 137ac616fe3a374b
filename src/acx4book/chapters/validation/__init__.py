"""Chapter 4, direct georeferencing on an independent block (section 4.3, Table 4).

`tables` puts several validations side by side, and the paper's Table 4; `figures` draws them. The
method stands in the notebook.
"""
