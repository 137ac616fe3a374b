"""Control and check points found in the pictures.

A signalised point is a disc, bright on a dark ground or the reverse: `discs` finds and centres such
discs, `votes` tells the targets from other spots by what all pictures say, `targets` goes through a
block. `natural` carries a point that is measured in one picture into all others by matching. Begin
with `found`.
"""
