"""Drives over a plane, a sine and hills given as maps: the scenes, one file an engine, tables and picture."""
