"""The paper held against itself: every finding computed from the printed numbers.

`audit` lists the findings of the heads (Table 1), `mounting` (Table 3), `validation` (Table 4) and
of the text (equations and wording), and what was checked and found in order.
"""
