"""One file per scene, with its closed form or its reference."""
