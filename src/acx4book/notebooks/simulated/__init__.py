"""Plans and the simulator, which reads none: a plan as it takes it, and the plan of a design of it.

`to_simulator` gives it a plan as plain numbers; `of_design` makes a plan of one of its designs.
"""
