"""One bundle adjustment for every use (sections 2.1 and 2.2, eqs 1-14).

Self-calibration, observed orientations, a camera mounted on an observed body and a rig of heads
are one `network`: it composes the `observations` and their derivatives by the `unknowns`, and
`adjust` sets up each of the four and adjusts it, `free_network` shows what is left open without
control and trajectory. `start` finds approximate values, `gross_errors` finds `rejections` and
removes them, `reliability` computes detectable errors, `variance_components` compares standard
deviations with residuals. Begin with `network`, then `adjust`.
"""
