"""impactcell: friction from taps, followed over wear, batch and stroke, and used to place parts."""

import os

# Matrices here have tens of rows, where a second BLAS thread costs ten times what it gives. Read by
# numpy when it is first imported; set the variable yourself to have it otherwise.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def __getattr__(name: str) -> str:
    """Give `__version__`, looked up where it is asked for: most verbs start sooner without."""
    if name != "__version__":
        raise AttributeError(f"module 'impactcell' has no attribute '{name}'")
    from importlib.metadata import version

    return version("impactcell")
