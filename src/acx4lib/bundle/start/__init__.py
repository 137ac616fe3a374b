"""Where a bundle begins: orientations from few points, rays that miss, what most agree on."""
