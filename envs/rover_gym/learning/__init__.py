"""Learning with stable-baselines3; needs the extra `train`."""
