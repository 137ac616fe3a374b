"""The report as one document to be printed: `cells` runs its notebook, `page` makes a file of it.

Its text is `markdown` made HTML.
"""
