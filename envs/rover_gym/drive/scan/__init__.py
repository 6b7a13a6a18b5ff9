"""The policy that plans over the height scan."""
