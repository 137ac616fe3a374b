"""Calibration: estimates, and how well they are determined (sections 2.1, 2.2, Tables 1 and 3).

`heads` are calibrated one by one and oriented to each other (section 4.1, Table 1). `mounting`
gives interior orientation, boresight and lever arm by a single step, eq. (14), or by two, the
second of which averages mountings, eqs (12) and (13) (section 4.2, Table 3), and scales standard
deviations; `rig` adjusts all heads at once. Each returns `estimates`. `common_errors` are those
that the points of a picture share, `trajectory_errors` those of the trajectory, estimated, and
whether headings depend on the course. `determination`, `stability` and `held` assess the estimates;
`diagnosis` has it all, and compares declared mountings. Begin with `mounting`.
"""
