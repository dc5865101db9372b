"""Tests run with as many threads of BLAS as the product: two that wait for each other cost a lot."""

import os

import numpy as np
from threadpoolctl import threadpool_info


def test_numpy_was_imported_after_the_package_had_said_how_many() -> None:
    np.ones((2, 2)) @ np.ones((2, 2))
    threads = [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]
    assert threads
    assert set(threads) == {int(os.environ["OPENBLAS_NUM_THREADS"])}
