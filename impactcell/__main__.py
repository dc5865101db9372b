"""Where the command line begins; what takes time to import comes where Ctrl-C is waited for."""

import sys


def main(arguments: list[str] | None = None) -> None:
    """Run one verb of `impactcell.cli.app`; Ctrl-C ends it with 130, also before it has begun."""
    try:
        from impactcell.cli.app import run_verb

        run_verb(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
