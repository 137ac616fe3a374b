"""The paper's printed numbers, compared with a run and with each other.

`printed` has Tables 1-4 and the checked statements of the text, transcribed once. `scorecard` puts
each number beside a run's, with a verdict by one rule and what its agreement means. `errata` finds
where the paper disagrees with itself. `questions` has the paper's four aims as questions, with its
answers and those of a run. Begin with `printed`.
"""
