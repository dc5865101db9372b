"""impactcell: friction from taps, followed over wear, batch and stroke, and used to place parts."""

import os
from importlib.metadata import version

# Matrices here have tens of rows, where a second BLAS thread costs ten times what it gives. Read by
# numpy when it is first imported; set the variable yourself to have it otherwise.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__version__ = version("impactcell")
