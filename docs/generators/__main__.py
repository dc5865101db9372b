"""Print what is made from the code: `PYTHONPATH=docs .venv/bin/python -m generators rooms.md`."""

import sys

from generators import PAGES

if __name__ == "__main__":
    asked = sys.argv[1:]
    if not asked or not set(asked) <= set(PAGES):
        sys.exit(f"name some of {', '.join(PAGES)}")
    sys.stdout.write("\n\n".join(PAGES[name]() for name in asked) + "\n")
