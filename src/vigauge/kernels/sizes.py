"""Sizes of blocks of parameters, named once."""

# Position and rotation of a keyframe, which images see.
POSE = 6
# All of a keyframe: position, rotation, velocity.
KEYFRAME = 9
# And with the gyroscope's and the accelerometer's bias, where they are estimated.
WITH_BIASES = 15
LANDMARK = 3
# Directions of the usual gauge: yaw and translation. Any other number is served too.
GAUGE = 4
