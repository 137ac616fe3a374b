"""Pictures of the heads: exact rays to the scenery, light, lens and sensor."""
