"""Chapter 0, the flight that is read (section 3.2): its blocks beside the paper's.

`tables` says what flew; the maps are `typesetting.maps`, since other chapters draw them too.
"""
