"""Shared by all tests: which run, where the sample data lie, and no asyncio task may outlive its test."""

import asyncio
import gc
import logging
import os
import sys
from collections.abc import AsyncIterator, Generator, Iterator
from itertools import compress, islice
from operator import not_
from pathlib import Path

import pytest
import pytest_asyncio
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers
from xdist.workermanage import WorkerController

import impactcell  # noqa: F401  # says how many threads numpy takes, and so comes before numpy
from tests.between_workers import share_in

TESTS = Path(__file__).resolve().parent
SHARED = TESTS.parents[1] / "shared" / "data"
LOG_LEVELS = {name: logging.getLogger(name).level for name in ("", "impactcell", "simulator")}

# The same examples in every run, and no example fails because the machine was busy. Hypothesis also draws
# constants from the modules imported so far, and which those are depends on what a worker has run before:
# they are left to the search, `pytest --hypothesis-profile search`, whose examples are new each time.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("search", settings.get_profile("repeatable"), derandomize=False, print_blob=True)
settings.load_profile("repeatable")
_is_local = providers.is_local_module_file
providers.is_local_module_file = lambda path: settings.default.derandomize is False and _is_local(path)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Run one worker more than there are processors: many tests wait for a browser, a kill or a child."""
    return (os.cpu_count() or 1) + 1


class DoctestsOfTheProduct:
    """Looks for doctests where there are any: in the product, and there only in files with a prompt.

    What tests are made of has none, and takes long to import; to look through all that a module without one
    defines takes long too.
    """

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(
        self, file_path: Path
    ) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
        collectors = yield
        if file_path.suffix == ".py" and (TESTS in file_path.parents or b">>>" not in file_path.read_bytes()):
            return [collector for collector in collectors if type(collector) is pytest.Module]
        return collectors


class CollectionFromElsewhere:
    """Has each worker begin to collect elsewhere: bytecode that one has written, the others read.

    Of a fresh checkout each would compile all that it imports. The order of tests is settled afterwards.
    """

    def __init__(self, worker: int, workers: int) -> None:
        self._share = worker / workers

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        report = yield
        if isinstance(collector, pytest.Directory) and report.passed:
            first = int(self._share * len(report.result))
            report.result = [*report.result[first:], *report.result[:first]]
        return report


def pytest_configure(config: pytest.Config) -> None:
    """Let the choice of doctests hold for the product too, which does not lie below this file."""
    config.pluginmanager.register(DoctestsOfTheProduct())
    if hasattr(config, "workerinput"):
        worker = int(config.workerinput["workerid"].removeprefix("gw"))
        workers = int(config.workerinput["workercount"])
        config.pluginmanager.register(CollectionFromElsewhere(worker, workers))


def is_quick(config: pytest.Config) -> bool:
    """Say whether slow tests are left out: nothing is named, and it is not CI."""
    if hasattr(config, "workerinput"):
        return bool(config.workerinput["is_quick"])
    return not config.getoption("file_or_dir") and os.environ.get("IMPACTCELL_CI") != "1"


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: WorkerController) -> None:
    """Tell each worker, to which all directories are named."""
    node.workerinput["is_quick"] = is_quick(node.config)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was left out, and how it is run."""
    if is_quick(config):
        terminalreporter.write_line(
            'Tests that take a second or more were left out: ARGS="tests impactcell" runs all.'
        )


def leave_out_slow_tests(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take those that are marked as slow, or as long, from what was collected."""
    is_slow = [any(item.iter_markers("slow")) or any(item.iter_markers("long")) for item in items]
    config.hook.pytest_deselected(items=list(compress(items, is_slow)))
    items[:] = list(compress(items, map(not_, is_slow)))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out slow tests of a quick run, and have each worker begin with some of the long ones.

    All would wait for one that began last. Workers are given as many neighbouring tests each, and then take
    from each other; those of a file stay together, for they may have fixtures in common.
    """
    items.sort(key=lambda item: str(item.path))
    if is_quick(config):
        leave_out_slow_tests(config, items)
    workers: int = getattr(config, "workerinput", {"workercount": 1})["workercount"]
    is_long = [item.get_closest_marker("long") is not None for item in items]
    long, short = list(compress(items, is_long)), compress(items, map(not_, is_long))
    files = list(dict.fromkeys(item.path for item in long))
    ordered: list[pytest.Item] = []
    for worker in range(workers):
        first = [item for item in long if files.index(item.path) % workers == worker]
        share = (len(items) - len(ordered)) // (workers - worker)
        ordered += [*first, *islice(short, max(0, share - len(first)))]
    items[:] = ordered


def pytest_collection() -> None:
    """Collect no garbage while tests are collected, which leaves next to none: a quarter of that time."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Keep the garbage collector from looking through all modules again and again: a third of the time."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def standard_nodes_once() -> Iterator[None]:
    """Build the standard nodes of OPC UA once, and not for each server."""
    if "asyncua" not in sys.modules:  # no test of this run needs it
        yield
        return
    from asyncua.server.internal_server import InternalServer

    from tests import standard_nodes

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(InternalServer, "load_standard_address_space", standard_nodes.load)
        yield


@pytest.fixture(scope="session", autouse=True)
def results_between_workers(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Have the workers of this run, and of no other, find what one of them has computed."""
    own = tmp_path_factory.getbasetemp()
    share_in(own.parent if hasattr(request.config, "workerinput") else own)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Directory of the sample campaigns and real slides; the test skips where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("the sample data are not beside this checkout")
    return SHARED


@pytest.fixture(autouse=True)
def same_log_level() -> None:
    """Give every test the log level of the beginning, whatever a test or a fixture of a module has set.

    `-q` of one must not silence the next, nor a verb that ran in one make the next say what it did.
    """
    for name, level in LOG_LEVELS.items():
        logging.getLogger(name).setLevel(level)


@pytest_asyncio.fixture
async def leak_check() -> AsyncIterator[None]:
    """Fail when the test leaves a task running."""
    before = asyncio.all_tasks()
    yield
    after = asyncio.all_tasks() - before - {asyncio.current_task()}
    leaked = {task for task in after if not task.done()}
    assert not leaked, f"tasks left running: {sorted(task.get_name() for task in leaked)}"


@pytest.fixture(autouse=True)
def no_leaked_tasks(request: pytest.FixtureRequest) -> None:
    """Put every asynchronous test under the leak check."""
    if request.node.get_closest_marker("asyncio") is not None:
        request.getfixturevalue("leak_check")
