"""What the estimates can be trusted for.

`determination` has what is determined worst, `detectable` which errors of observations would be
found and what others do, `needs` the flight geometry that a parameter needs,
`steady` what sigma would be without wind and hills,
`confirmation` whether estimated mountings are those that were declared, and
`joint_tests` whether several parameters together differ from given values.
"""
