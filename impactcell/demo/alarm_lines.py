"""Alarms as a terminal shows them: whole where there is room, else a line each and how many more."""

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from impactcell.records import Alarm


def whole_alarms(alarms: Sequence[Alarm], *, wide: bool) -> RenderableType:
    """Show each alarm that needs a look with its whole message; in a wide terminal as a table."""
    shown = _needing_a_look(alarms)
    if not shown:
        return Text("no alarms", style="green")
    if not wide:
        return Group(*map(_line, shown))
    table = Table(expand=True, box=None, header_style="dim", padding=(0, 2, 0, 0))
    for heading in ("alarm", "state", "since cycle"):
        table.add_column(heading, no_wrap=True)
    table.add_column("message", ratio=1)
    for alarm in shown:
        table.add_row(_name(alarm), _state(alarm), str(alarm.cycle), _message(alarm))
    return table


def alarms_within(alarms: Sequence[Alarm], rows: int) -> RenderableType:
    """Show alarms in at most so many rows, at least one: a cut line each, the last says how many more."""
    shown = _needing_a_look(alarms)
    if not shown:
        return Text("no alarms", style="green")
    first = len(shown) if len(shown) <= rows else max(rows - 1, 0)
    lines = [_line(alarm) for alarm in shown[:first]]
    if rest := shown[first:]:
        count = f"+{len(rest)} more" if first else f"{len(rest)} alarms"
        lines.append(Text(f"{count}: {', '.join(alarm.name for alarm in rest)}", style="bold"))
    for line in lines:
        line.no_wrap, line.overflow = True, "ellipsis"
    return Group(*lines)


def _needing_a_look(alarms: Sequence[Alarm]) -> list[Alarm]:
    """Choose what is active or not acknowledged; active ones first, and of these the severest."""
    chosen = [alarm for alarm in alarms if alarm.active or not alarm.acknowledged]
    return sorted(chosen, key=lambda alarm: (not alarm.active, -alarm.severity))


def _line(alarm: Alarm) -> Text:
    return Text.assemble(_name(alarm), f" {_state(alarm)} since cycle {alarm.cycle}: {_message(alarm)}")


def _name(alarm: Alarm) -> Text:
    return Text(alarm.name, style="bold red" if alarm.active else "yellow")


def _message(alarm: Alarm) -> str:
    """Give what an alarm says; of one that has cleared, as what it said."""
    return alarm.message if alarm.active else f"it said: {alarm.message}"


def _state(alarm: Alarm) -> str:
    return ("active" if alarm.active else "cleared") + ("" if alarm.acknowledged else ", unacknowledged")
