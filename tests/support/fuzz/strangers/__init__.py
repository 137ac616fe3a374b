"""Files of other programs with mutations, imported: a flight, or a sentence, must come out."""
