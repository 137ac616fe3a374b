"""One bundle adjustment for every use (sections 2.1 and 2.2, eqs 1-14).

Self-calibration, observed orientations, a camera mounted on an observed body and a rig of heads
are one adjustment. To read it, begin with `unknowns`: the parameters, and the column of each. A
`network` is a block with its unknowns; it linearises the image points, eqs (1)-(11) and (14), and
`observations` all that is observed besides. `adjust` sets up a network for each of the four uses
and adjusts it, from the approximate values of `start`.

`gross_errors` finds wrong observations and removes them, within the limits of `rejections`;
`reliability` computes detectable errors; `variance_components` compares standard deviations with
residuals; `free_network` shows what is left open without control and trajectory. `compiled` has
the fast versions of the passes over all rays; nothing but the network enters it.
"""
