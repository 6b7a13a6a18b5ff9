"""Searches for the cheapest way: over a height scan, over a map of scans, over a whole field."""
