"""Certified regression problems of NIST."""
