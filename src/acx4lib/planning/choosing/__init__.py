"""Which strips are flown: the cheapest of many candidates that give what is wanted.

`target` reads what is wanted, and the candidates. `strip_information` has what every strip tells,
reduced to what all strips share, so that any choice is a sum; `search` finds a cheap choice, and
knows of no strips. `chosen` joins the two, and computes the chosen flight as a plan of its own.
Begin there.
"""
