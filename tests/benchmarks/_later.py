"""What the product does that it did not do before the rooms were set up, and the modules for it alone.

Lines are held to a bar that was set for the functions of then. The list is kept by hand: a module stands here
only where nothing of it was there before under any name, and would be gone with the function. What modules of
then have learned since is not taken off, so that the count is too high rather than too low.
"""

import re
from collections.abc import Mapping, Sequence

from tests.benchmarks import _syntax
from tests.benchmarks._lists import Count

LATER: Mapping[str, str] = {
    "the live page": (
        r"web(\..*)?|service\.(page_servers|page_gateway)|settings\.web_section|process\.background"
    ),
    "import of files as people have them": r"measurements(\..*)?|cli\.import_files|campaign\.contacts",
    "quality of recorded data": r"quality(\..*)?",
    "laws that nobody had listed, in the cell": r"discrepancy\.laws(\..*)?|physics\.(free_\w*forms|bspline)",
    "machines that are no cell": (
        r"discrepancy\.machine(\..*)?|discrepancy\.report\.machine_\w+|settings\.base_model"
    ),
    "verdicts beside model error, by held-out shots, and what they advise": (
        r"discrepancy\.search\.(conclusion|convergence|dominance|held_out|model_error|open_loop)"
        r"|discrepancy\.report\.sentences"
    ),
    "reports in German": r"german(\..*)?|discrepancy\.report\.german_\w+",
    "effects of the user's own": r"physics\.(outside_effects|effect_contract)|cli\.(effects|cluster)",
    "a public API": r"api(\..*)?",
    "a cell from nothing: init, a first model, judgement": r"cli\.(init|first_model)|settings\.judgement",
    "modules on serial lines, over UDP and through gateways, and proved when connected": (
        r"fieldbus\.(transports\.(checked_pymodbus|shared_line|batch_in_flight|reply_watch)|probe|identity|bcd"
        r"|plausibility|register_image|register_client|map_promises|device_identification)|cli\.probe"
    ),
    "budgets and languages of OPC UA, history by a process of its own": (
        r"opcua\.(loop_share|read_budget|item_room|languages|login_throttle)|scada\.german\w*"
        r"|journal\.(trend|history_reader)"
    ),
    "state and journal over versions and damage": (
        r"serialization\.versioned|journal\.(migrations|salvage|checksums|presence)"
    ),
    "wear with an unknown batch by all cycles at once": r"tracking\.wear_batch\.(wear_blocks|block_filter)",
    "a planner that knows what its model lacks": (
        r"positioning\.(displacement_discrepancy|scatter_hypotheses|prediction_watch)"
    ),
}
"""Patterns of modules below `impactcell`, by what they are for."""


def since_then(parsed: Sequence[_syntax.Module]) -> Count:
    """Lines of what came later; each of `LATER` with its own."""
    items, total = [], 0
    for purpose, pattern in LATER.items():
        whole = re.compile(rf"impactcell\.({pattern})")
        lines = sum(len(module.lines) for module in parsed if whole.fullmatch(module.name))
        items.append(f"{lines}: {purpose}")
        total += lines
    return Count(total, tuple(items))
