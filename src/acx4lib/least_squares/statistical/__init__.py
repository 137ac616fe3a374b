"""Tests of observations, and the distributions of tests."""
