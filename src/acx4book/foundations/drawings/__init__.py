"""The figures of part I: a module for each chapter, named as the chapter."""
