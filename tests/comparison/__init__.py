"""What the simulator reaches beside other engines: error against cost, and the scenes where methods fail."""

import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # before NumPy is loaded: one thread for every engine
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
