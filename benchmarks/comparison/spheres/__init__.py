"""SimBenchmark's scenes of free spheres: what they are, one file an engine, tables and picture."""
