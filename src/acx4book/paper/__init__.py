"""What the paper prints, held against a run and against itself.

`printed` has Tables 1-4 and the checked statements of the text, transcribed once. `scorecard` puts
each number beside a run's, with a verdict by one rule and what its agreement means. `errata` finds
where the paper disagrees with itself, and `absorbed` what a run says of the lever arm in Table 3.
`questions` has the paper's four aims as questions, with its answers and those of a run. Begin with
`printed`.
"""
