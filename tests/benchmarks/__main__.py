"""Print benchmark tables: `python -m tests.benchmarks [TOPIC ...] [--quick]`; tables go to stdout.

Every module of this package with a function `tables()` is a topic. With `--quick`, `QUICK` is set in
the environment of the topics that offer smaller sizes (their `tables` takes `quick`).
"""

import argparse
import importlib
import inspect
import pkgutil
import sys
import time

import impactcell  # noqa: F401  # says how many threads numpy takes, and so comes before numpy
import tests.benchmarks

NOT_TOPICS = {"__main__", "table"}


def topics() -> list[str]:
    names = (module.name for module in pkgutil.iter_modules(tests.benchmarks.__path__))
    return sorted(name for name in names if name not in NOT_TOPICS and not name.startswith("_"))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("topic", nargs="*", help=f"any of: {', '.join(topics())} (all by default)")
    parser.add_argument("--quick", action="store_true", help="smaller sizes where a topic offers them")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.topic) - set(topics()))
    if unknown:
        parser.error(f"no such topic: {', '.join(unknown)}; there are {', '.join(topics())}")
    failed = 0
    for topic in arguments.topic or topics():
        print(f"{topic} ...", file=sys.stderr, flush=True)
        started = time.perf_counter()
        try:
            module = importlib.import_module(f"tests.benchmarks.{topic}")
            if not hasattr(module, "tables"):
                continue
            takes_quick = "quick" in inspect.signature(module.tables).parameters
            made = module.tables(quick=arguments.quick) if takes_quick else module.tables()
            for table in made:
                print(table.markdown(), flush=True)
        except Exception as error:  # noqa: BLE001  # one topic that fails does not take the others with it
            import traceback

            traceback.print_exc()
            print(f"{topic}: FAILED: {error}", file=sys.stderr, flush=True)
            failed += 1
        print(f"{topic}: {time.perf_counter() - started:.1f} s", file=sys.stderr, flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
