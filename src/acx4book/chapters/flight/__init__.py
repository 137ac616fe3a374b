"""Chapter 0, the flight that is read (section 3.2): its blocks beside the paper's.

`tables` has what the paper says of its flight; maps are `typesetting.maps`, since other chapters
draw them too. `exposure` is a figure in space for the front page.
"""
