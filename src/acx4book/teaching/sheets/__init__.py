"""The nine lab sheets: a module for each, with its questions, solution and mistakes.

`every` lists them. The text for students is in the book, page by page.
"""
