"""Effects from outside of the package: a file, a folder of files, or an installed plug-in.

Such a file is like one of `impactcell.physics.effects`: it defines one `EFFECT` of the file's name. It is
Python and is run: load only files that you trust as much as the program itself.
"""

import atexit
import importlib.util
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from pathlib import Path

from impactcell.errors import PhysicsError
from impactcell.physics.effect import Effect
from impactcell.physics.effects import LIBRARY, offer_effect

GROUP = "impactcell.effects"
"""Entry-point group of plug-ins: each entry point names an `EFFECT`, or a module that has one."""
_SOURCES: dict[Effect, Path] = {}
"""File that each effect came from; also of those that were withdrawn."""
_PACKAGE = "impactcell_outside_effects"
"""Prefix of the names under which files are imported."""


def effect_files(path: Path) -> list[Path]:
    """Give the files of effects that a path names: itself, or those of a folder.

    Raises
    ------
    PhysicsError
        There is no such file or folder, it cannot be read, or nothing is in it.
    """
    try:
        is_file, is_folder = path.is_file(), path.is_dir()
    except OSError as error:
        raise PhysicsError(f"{path}: cannot be read: {error.strerror}") from error
    if is_file:
        return [path]
    if not is_folder:
        raise PhysicsError(f"{path}: there is no such file or folder of effects")
    files = sorted(file for file in path.glob("*.py") if not file.name.startswith("_"))
    if not files:
        raise PhysicsError(f"{path}: has no file of an effect (*.py)")
    return files


def load_effect(file: Path) -> Effect:
    """Run the file of an effect and give its `EFFECT`.

    Raises
    ------
    PhysicsError
        The file cannot be run, or has no `EFFECT` of its own name.
    """
    if not file.stem.isidentifier():
        raise PhysicsError(
            f"{file}: {file.stem!r} is no identifier; name the file after its effect, as my_effect.py"
        )
    name = f"{_PACKAGE}.{file.stem}"
    specification = importlib.util.spec_from_file_location(name, file)
    if specification is None or specification.loader is None:
        raise PhysicsError(f"{file}: is no Python file")
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    try:
        specification.loader.exec_module(module)
    except SyntaxError as error:
        raise PhysicsError(f"{file}:{error.lineno}: {error.msg}") from error
    except SystemExit as error:
        raise PhysicsError(
            f"{file}{_line(error, file)}: ends the program as it is read; take `exit` out of it"
        ) from error
    except Exception as error:
        raise PhysicsError(f"{file}{_line(error, file)}: {type(error).__name__}: {error}") from error
    return _checked(getattr(module, "EFFECT", None), str(file), file.stem)


def offer_effects(paths: Sequence[Path]) -> tuple[str, ...]:
    """Load the effects of files and folders and offer them; give their identifiers.

    One that is offered already from the same file is left as it is; a file that has changed since then counts
    from the next start on.

    Raises
    ------
    PhysicsError
        Every file that cannot be used, a line each; nothing is offered then.
    """
    loaded: dict[Path, Effect] = {}
    faults: list[str] = []
    for path in paths:
        for file in effect_files(path):
            if source_of(file.stem) == file.resolve():
                continue
            try:
                effect = load_effect(file)
            except PhysicsError as error:
                faults.append(str(error))
                continue
            if effect.identifier in LIBRARY or any(
                effect.identifier == e.identifier for e in loaded.values()
            ):
                faults.append(
                    f"{file}: an effect called {effect.identifier!r} is there already; give yours a new name"
                )
            loaded[file.resolve()] = effect
    if faults:
        raise PhysicsError("\n".join(faults))
    for file, effect in loaded.items():
        offer_effect(effect)
        _SOURCES[effect] = file
    return tuple(effect.identifier for effect in loaded.values())


def offered_texts() -> dict[str, str]:
    """Give the text of each file of effects on offer, by its effect: what another process needs."""
    return {
        effect.identifier: file.read_text(encoding="utf-8")
        for effect, file in _SOURCES.items()
        if LIBRARY.get(effect.identifier) is effect
    }


def offer_texts(texts: Mapping[str, str]) -> None:
    """Offer the effects of another process, as `offered_texts` gives them there.

    Raises
    ------
    PhysicsError
        As `offer_effects`, and where an effect of the same name but with another text is on offer here.
    """
    here = offered_texts()
    changed = [
        identifier for identifier in texts if here.get(identifier, texts[identifier]) != texts[identifier]
    ]
    if changed:
        raise PhysicsError(f"has another {', '.join(changed)} on offer; start it anew")
    folder = Path(tempfile.mkdtemp(prefix="impactcell-effects-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    files = [folder / f"{identifier}.py" for identifier in texts if identifier not in here]
    for file in files:
        file.write_text(texts[file.stem], encoding="utf-8")
    offer_effects(files)


def source_of(identifier: str) -> Path | None:
    """File that an effect on offer came from; None for those of the product and of plug-ins."""
    effect = LIBRARY.get(identifier)
    return None if effect is None else _SOURCES.get(effect)


def offer_installed() -> tuple[str, ...]:
    """Offer the effects of installed plug-ins; give their identifiers.

    Raises
    ------
    PhysicsError
        Every plug-in that cannot be used, with the way out.
    """
    identifiers: list[str] = []
    faults: list[str] = []
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        owner = point.dist.name if point.dist is not None else point.value
        place = f"plug-in {point.name!r} of {owner}"
        try:
            content = point.load()
            effect = _checked(getattr(content, "EFFECT", content), place, point.name)
            if LIBRARY.get(effect.identifier) is not effect:
                offer_effect(effect)
            identifiers.append(effect.identifier)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - somebody else's code may raise anything
            faults.append(f"{place}: {error}; mend it, or pip uninstall {owner}")
    if faults:
        raise PhysicsError("\n".join(faults))
    return tuple(identifiers)


def _checked(effect: object, place: str, name: str) -> Effect:
    if not isinstance(effect, Effect):
        raise PhysicsError(f"{place}: defines no EFFECT = Effect(...)")
    if effect.identifier != name:
        raise PhysicsError(f"{place}: calls its effect {effect.identifier!r}; call it {name!r} too")
    return effect


def _line(error: BaseException, file: Path) -> str:
    """Line of the file in which an error arose, as `:12`; empty where it is elsewhere."""
    trace, line = error.__traceback__, ""
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename) == file:
            line = f":{trace.tb_lineno}"
        trace = trace.tb_next
    return line
