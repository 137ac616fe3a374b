"""Bundle adjustments of DBAT, PhotoModeler and AICON: their files, reports and numbers."""
