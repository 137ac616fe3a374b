"""What was calibrated and how: `describe` has identification, method and data."""
