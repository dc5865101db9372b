"""Command line of the simulator: `serve SCENARIO.yaml` and `campaign SCENARIO.yaml -o DIR`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from impactcell.errors import SettingsError
from impactcell.process.exit_codes import exit_code_of

MOST_PORT = 65_535
"""Largest TCP port."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    options = _parser().parse_args(arguments)
    return exit_code_of("simulator", lambda: int(options.run(options)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m simulator", description="A cell that strikes a simulated part."
    )
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")
    campaign = verbs.add_parser("campaign", help="write a campaign directory and its truth")
    campaign.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="as config/sim/campaign.yaml")
    campaign.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="a directory that is empty, or not there yet",
    )
    campaign.add_argument(
        "--hide", action="append", default=[], metavar="EFFECT", help="effect that acts; repeatable"
    )
    campaign.add_argument("--seed", type=int, help="in place of the scenario's")
    campaign.add_argument("-q", "--quiet", action="store_true", help="say nothing")
    campaign.add_argument("-v", "--verbose", action="store_true", help="say what is hidden")
    campaign.set_defaults(run=_campaign)
    serve = verbs.add_parser("serve", help="serve a scenario over Modbus TCP until SIGTERM")
    serve.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="as config/sim/prototype.yaml")
    serve.add_argument("--port", type=_port, help="in place of the scenario's; 0 lets the system choose")
    serve.add_argument(
        "--truth", type=Path, metavar="FILE", help="write what really happened, a JSON line a cycle"
    )
    serve.add_argument(
        "--until-stdin-ends", action="store_true", help="end with standard input, as a pipe from a parent"
    )
    serve.add_argument("-q", "--quiet", action="store_true", help="only errors and the address it listens at")
    serve.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="what really happened, a JSON line a cycle, also on standard error",
    )
    serve.set_defaults(run=_serve)
    return parser


def _port(text: str) -> int:
    port = int(text)
    if not 0 <= port <= MOST_PORT:
        raise ValueError(text)
    return port


def _serve(options: argparse.Namespace) -> int:
    from simulator.serving import read_scenario_and_map, run

    scenario, registers = read_scenario_and_map(options.scenario)
    if options.port is not None:
        scenario = scenario.model_copy(
            update={"listen": scenario.listen.model_copy(update={"port": options.port})}
        )
    return run(
        scenario,
        registers,
        options.truth,
        verbose=options.verbose,
        until_stdin_ends=options.until_stdin_ends,
    )


def _campaign(options: argparse.Namespace) -> int:
    from pydantic import ValidationError

    from simulator.campaign_files import write
    from simulator.campaign_scenario import CampaignScenario
    from simulator.scenario_file import load

    scenario = load(options.scenario, CampaignScenario)
    changed = scenario.model_dump() | {"hide": list(dict.fromkeys([*scenario.hide, *options.hide]))}
    if options.seed is not None:
        changed["seed"] = options.seed
    try:
        scenario = CampaignScenario.model_validate(changed)
    except ValidationError as error:
        message = "; ".join(fault["msg"].removeprefix("Value error, ") for fault in error.errors())
        raise SettingsError(message) from None
    truth = write(scenario, options.output)
    if not options.quiet:
        hidden = f", hidden: {', '.join(scenario.hide) or 'nothing'}" if options.verbose else ""
        print(f"{options.output} (truth: {truth}){hidden}")  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
