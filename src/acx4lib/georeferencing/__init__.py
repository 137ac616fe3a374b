"""Direct georeferencing, tested (section 4.3, Table 4).

`direct` gives the pose of every image by eq. (14) and intersects rays, or single pixels on a known
height, without any ground control. `validation` compares the points with surveyed ones, pair by
pair as the paper and from all rays, and predicts exposures that were held out; `error_sources`
are common to differences, for joint tests. `budget` splits predicted variances by their sources
and by parameters, and predicts those of a regular mapping flight. `accuracy` has statistics, tests
and map classes of differences; `forgotten` leaves out one step, to show its effect. Begin with
`direct`.
"""
