"""What the paper prints, held against a run (`scorecard`) and against itself (`errata`)."""
