"""The simulator: trajectories, landmarks, measurements."""
