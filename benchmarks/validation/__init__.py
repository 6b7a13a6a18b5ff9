"""Validation of grains as granular matter, against papers and closed forms."""

import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # before NumPy is loaded: the runs are the work, not the statistics
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
