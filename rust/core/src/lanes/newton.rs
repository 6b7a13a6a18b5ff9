//! Semismooth Newton on several contact problems side by side.
