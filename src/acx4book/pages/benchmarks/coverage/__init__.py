"""The page on what ``make coverage`` left: errors over their standard deviations.

`sigma` by `sigma_tests`; `bias`, what errors leave in the mean; `slow_errors` of a trajectory;
`verdicts` of reports on good and on spoilt flights.
"""
