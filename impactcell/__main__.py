"""Where the command line begins; what takes time to import comes where Ctrl-C is waited for."""

import sys

from impactcell.process.exit_codes import ExitCode, exit_code_of


def main(arguments: list[str] | None = None) -> None:
    """Run one verb of `impactcell.cli.app`; Ctrl-C ends it with 130, also before it has begun."""

    def run() -> None:
        from impactcell.cli.app import run_verb

        run_verb(arguments)

    code = exit_code_of("impactcell", run)
    if code == ExitCode.INTERRUPTED:
        sys.stderr.write("interrupted\n")
    sys.exit(code)


if __name__ == "__main__":
    main()
