"""Fits on a dask cluster, whose workers are given the effects that the user has brought."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from distributed import Client, Worker, WorkerPlugin

from impactcell.discrepancy.search import Mapper
from impactcell.errors import DiscrepancyError, PhysicsError
from impactcell.physics.outside_effects import offer_texts, offered_texts

ANSWER_S = 30
"""Longest wait for the scheduler's answer, seconds."""


class OutsideEffects(WorkerPlugin):
    """Offers effects in every worker, those that join later too."""

    name = "impactcell-effects"

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = texts

    def setup(self, worker: Worker) -> None:  # noqa: ARG002 - as dask calls it
        """Offer them; as `offer_texts`."""
        offer_texts(self._texts)


@contextmanager
def cluster_mapper(scheduler: str) -> Iterator[Mapper]:
    """`map` on the workers of a scheduler; the outcome is that of one process.

    Raises
    ------
    DiscrepancyError
        No scheduler answers, or a worker cannot offer the effects that were brought here.
    """
    try:
        client: Any = Client(scheduler, timeout=ANSWER_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise DiscrepancyError(f"no dask scheduler answers at {scheduler}: {error}") from error
    with client:
        if texts := offered_texts():
            try:
                client.register_plugin(OutsideEffects(texts))
            except PhysicsError as error:
                raise DiscrepancyError(f"a worker of {scheduler}: {error}") from error

        def on_cluster(function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
            futures = [client.submit(function, item, pure=False) for item in items]
            return list(client.gather(futures))

        yield on_cluster
