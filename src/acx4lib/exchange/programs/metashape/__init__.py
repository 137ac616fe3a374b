"""Metashape: its lens model, and its projects and exported XML files.

Sources: the user manual's appendix on camera models (versions 1.2 to 2.2), and files that
Metashape 1.7 wrote.
"""
