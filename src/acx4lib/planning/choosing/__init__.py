"""Which strips are flown: the cheapest of many candidates that give what is wanted.

`target` reads what is wanted and the candidates. `strip_information` has what every candidate tells,
reduced to what all share, so that any choice is a sum; `search` finds a cheap one, and knows no
strips. `chosen` joins them, and computes the chosen flight anew, as a plan of its own. Begin there.
"""
