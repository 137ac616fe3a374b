"""The teaching kit: a flight for every student, and a check of the answers.

`flights` makes seeds of a name and the lecturer's key, and simulates the flight of a sheet.
`sheets` has every lab sheet: its
questions, its solution, and what the common mistakes would give. `handed_in` writes a student's
folder without its truth and reads the answers, `grading` compares them, and `class_table` lists a
class. Begin with `flights`, then `sheets`.
"""
