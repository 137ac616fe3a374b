"""The figures of part I, by topics."""
