"""The figures of part I, a module for every chapter."""
