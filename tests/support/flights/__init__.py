"""Flights that tests read: written by hand, simulated, with pictures, with payloads for names."""
