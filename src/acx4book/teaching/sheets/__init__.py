"""The nine lab sheets: the questions of each, its solution, and the common mistakes.

`every` lists them. The text for students is in the book, page by page.
"""
