"""What tests share: blocks, numeric derivatives, strategies, flights, pictures, wrong calls."""
