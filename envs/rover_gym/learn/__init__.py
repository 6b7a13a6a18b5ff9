"""Training with stable-baselines3; requires the extra `train`."""
