"""The back matter of the book: what is downloaded, printed, cited and carried along.

`clean` makes the notebooks that readers download; `licences` is a page; `citation`
says who made which version; `pdf` prints the whole book, and `release` packs it. Begin with
`clean`.
"""
