"""The report as one document to be printed."""
