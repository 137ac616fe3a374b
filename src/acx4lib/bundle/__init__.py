"""One bundle adjustment for every use (section 2, eqs 1-14).

Self-calibration, observed orientations, a camera mounted on an observed body and a rig of heads
are one `network`, whose observations and derivatives it composes; `adjust` adjusts it. Around it
stand start values, gross errors, reliability and variance components. Begin with `network`, then
`adjust`.
"""
