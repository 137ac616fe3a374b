"""Projects of other programs, written from one scene by their documented layouts."""
