//! The border between rover-core and Python.
