"""A ground to take pictures of: drawn from noise, or a photograph."""
