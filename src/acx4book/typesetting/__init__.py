"""How a number, a name, a table and a figure look.

Text of a flight passes `plain_text` on its way to a page, a figure or a terminal.
"""
