"""Chapter 10, how true the synthetic image is: points against an ideal picture (section 4.1).

`deviations` simulates an exposure with its truth and measures points of its synthetic image;
`examined` measures whole images and calibrates them by themselves; `figures` shows both.
"""
