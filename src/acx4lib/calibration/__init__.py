"""Calibration: estimates, and how well they are determined (sections 2.1, 2.2, Tables 1 and 3).

`heads` are calibrated one by one and oriented to each other (section 4.1, Table 1). `mounting`
gives interior orientation, boresight and lever arm by a single step, eq. (14), or by two, the
second of which averages mountings, eqs (12) and (13) (section 4.2, Table 3); `rig` adjusts all
heads at once, and `picture_turns` turns the pictures of an exposure that do not share its pose.
Each returns `estimates`. `weights` scales standard deviations, `trajectory_errors` reports the
estimated errors of the trajectory. `determination`, `joint_tests`, `jackknife`, `confirmation`
and `stability` assess the estimates, `courses` tests whether heading errors depend on the course.
Begin with `mounting`.
"""
