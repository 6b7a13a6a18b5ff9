"""What a rover drives on: the parts of a terrain, maps, sand, and beds of grains."""
