"""One bundle adjustment for every use (sections 2.1 and 2.2, eqs 1-14).

Self-calibration, observed orientations, a camera mounted on an observed body and a rig of heads
are one `network`: it composes the `observations` and their derivatives by the `unknowns`, and
`adjust` adjusts it. `uses` sets up each of the four, `free_network` does without control and
trajectory. `start` finds approximate values, `gross_errors` are found and taken out to
`rejections`, `reliability` says how large an error must be to be found, `variance_components`
whether the standard deviations agree with the residuals. Begin with `network`, then `adjust`.
"""
