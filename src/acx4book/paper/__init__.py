"""What the paper prints, held against a run and against itself.

`printed` has Tables 1-4 and the checked statements of the text, transcribed once. `scorecard` puts
each number beside a run's, with a verdict by one rule, and `scorecard_page` makes a page of it.
`errata` finds where the paper disagrees with itself. Begin with `printed`.
"""
