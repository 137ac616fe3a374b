"""Chapter 17, which distortion model: Brown's parameters beside two other families of the field.

`families` has Ebner's twelve polynomials and a Fourier series; `candidates` adjusts a network with
their coefficients as further unknowns; `cases` are lenses with and without asymmetry, and the
synthetic image. `trials` adjusts, leaves strips out and validates; `seams` asks what a model takes
up of the pattern of the synthetic image; `study` reads what ``make models`` left. `tables`,
`figures` and `sentences` show it, `exercises` has the solutions. Begin with `families`.
"""
