"""The policy that plans with the simulator itself."""
