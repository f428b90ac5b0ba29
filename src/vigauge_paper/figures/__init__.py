"""The figures of the paper."""

import os

# A notebook hands its backend down to the programs it starts; Matplotlib does not load with one it lacks.
os.environ["MPLBACKEND"] = "agg"
