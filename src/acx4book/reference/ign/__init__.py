"""A block of IGN's airborne camera, with surveyed points and the agency's orientation."""
