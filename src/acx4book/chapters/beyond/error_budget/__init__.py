"""Chapter 16, the error budget: where the error of a map comes from.

`as_printed` has the budget of the paper's own flight; `tables`, `figures` and `explorer` show
budgets. The method stands in the notebook.
"""
