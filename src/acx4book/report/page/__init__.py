"""The report as one document to be printed: `page`, whose text is `markdown` made HTML."""
