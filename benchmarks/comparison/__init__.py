"""Comparison with other engines: error against cost, and scenes on which methods fail."""

import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # before NumPy is loaded: one thread for every engine
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
