"""The notebooks run with parameters: one by `execute`, a flight's stages by `stages`."""
