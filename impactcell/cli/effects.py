"""Effects of the user's own: offered to a study, and checked."""

from collections.abc import Sequence
from pathlib import Path

from impactcell.errors import EffectError, PhysicsError
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import LIBRARY, withdraw_effect
from impactcell.physics.outside_effects import (
    effect_files,
    load_effect,
    offer_effects,
    offer_installed,
    source_of,
)
from impactcell.physics.usable_effect import faults_of_use
from impactcell.process.console import print_note, print_result


def offer(paths: Sequence[Path]) -> None:
    """Offer the effects of files and folders, and of installed plug-ins.

    Raises
    ------
    EffectError
        What cannot be used, a line each; nothing is offered then.
    """
    try:
        offered = (*offer_installed(), *offer_effects(paths))
    except PhysicsError as error:
        raise EffectError(str(error)) from error
    faults = [
        f"{source_of(identifier) or identifier}: {fault}"
        for identifier in offered
        for fault in faults_of_use(LIBRARY[identifier])
    ]
    if faults:
        for identifier in offered:
            withdraw_effect(identifier)
        raise EffectError("\n".join(faults))
    if offered:
        print_note(f"offered beside the library: {', '.join(offered)}")


def check_effects(paths: Sequence[Path]) -> None:
    """Hold the effects of files and folders to the contract.

    Raises
    ------
    EffectError
        What they break, a line each.
    """
    faults: list[str] = []
    files = []
    for path in paths:
        try:
            files += effect_files(path)
        except PhysicsError as error:
            faults.append(str(error))
    for file in files:
        try:
            broken = contract_faults(load_effect(file))
        except PhysicsError as error:
            faults.append(str(error))
            continue
        if broken:
            faults += [f"{file}: {fault}" for fault in broken]
        else:
            print_result(f"{file}: in order")
    if faults:
        raise EffectError("\n".join(faults))
