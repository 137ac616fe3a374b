"""Direct georeferencing, tested (section 4.3, Table 4).

`direct` gives the pose of every image by eq. (14) and intersects rays, or single pixels on a known
height, without any ground control. `validation` holds the points against surveyed ones, pair by
pair as the paper and from all rays, and predicts exposures that were held out; `error_sources` are
what differences share, for tests of all together. `budget` splits predicted variances by their
sources, and predicts those of a regular mapping flight; `weak` names the parameters that
have too much of them. `accuracy` says what the differences mean, and which map scale they allow;
`forgotten` leaves out one step, to see what that would do. Begin with `direct`.
"""
