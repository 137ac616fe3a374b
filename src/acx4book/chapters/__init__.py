"""What the chapters show: one folder for every notebook, in the order of the book.

A chapter's folder has its trials, tables, sentences and figures. What it computes for the results
folder is a stage of `acx4lib.stages`.
"""
