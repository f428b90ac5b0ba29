"""From stereo images and inertial samples to a problem."""
