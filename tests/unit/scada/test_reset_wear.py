"""Acting from elsewhere than OPC UA: the same right, bound and audit trail as the methods have."""

import logging
from types import SimpleNamespace

import pytest

from impactcell.alarms import EventKind
from impactcell.records import Alarm
from impactcell.scada import Actor, ConditionAction, RefusedError, Role
from impactcell.scada.conditions import MAX_SHELVE_S
from impactcell.scada.methods import MAX_COMMENT
from impactcell.scada.server import Server
from impactcell.web.messages import Messages

HALF = "gr\udcfc"
"""A comment in Latin-1, as a decoder gives it that keeps what it cannot read."""


class Actions:
    def __init__(self) -> None:
        self.done: list[tuple[str, str, str]] = []
        self.acted: list[tuple[EventKind, float]] = []

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        self.done.append((cell, comment, actor.user))

    async def act_on_condition(
        self, _cell: str, _alarm: str, event: EventKind, _actor: Actor, *, shelve_s: float, **_: object
    ) -> None:
        self.acted.append((event, shelve_s))


async def test_wear_is_reset_by_whom_the_method_lets_and_is_written_down(
    caplog: pytest.LogCaptureFixture,
) -> None:
    server, actions = Server.__new__(Server), Actions()
    server._actions = actions  # type: ignore[assignment]  # nothing else of it is asked
    with caplog.at_level(logging.INFO, "impactcell.audit"):
        for role in Role:
            actor = Actor(role.name, role, "10.0.0.7")
            if role >= Role.ENGINEER:
                await server.reset_wear("press-1", "new plate", actor)
            else:
                with pytest.raises(RefusedError, match="BadUserAccessDenied"):
                    await server.reset_wear("press-1", "new plate", actor)
        with pytest.raises(RefusedError, match="characters"):
            await server.reset_wear("press-1", "x" * (MAX_COMMENT + 1), actor)
        with pytest.raises(RefusedError, match="UTF-8"):
            await server.reset_wear("press-1", HALF, actor)
    assert actions.done == [("press-1", "new plate", "ENGINEER")]
    outcomes = [record.getMessage() for record in caplog.records]
    assert (
        sum("press-1: ResetWear('new plate'): refused, BadUserAccessDenied" in said for said in outcomes) == 2
    )
    assert "ENGINEER (engineer) from 10.0.0.7: press-1: ResetWear('new plate'): done" in outcomes


@pytest.mark.parametrize("event", [EventKind.ACKNOWLEDGE, EventKind.CONFIRM, EventKind.COMMENT])
async def test_a_comment_that_nothing_can_write_reaches_no_alarm(event: EventKind) -> None:
    server = Server.__new__(Server)  # nothing of it is asked
    action, actor = ConditionAction(event, b"", HALF), Actor("anna", Role.ENGINEER, "10.0.0.7")
    with pytest.raises(RefusedError, match="UTF-8"):
        await server.act_on_condition("press-1", "WearLimit", action, actor)


async def test_a_comment_without_a_text_reaches_no_alarm() -> None:
    server = Server.__new__(Server)  # nothing of it is asked
    action, actor = ConditionAction(EventKind.COMMENT, b""), Actor("anna", Role.ENGINEER, "10.0.0.7")
    with pytest.raises(RefusedError) as refused:
        await server.act_on_condition("press-1", "WearLimit", action, actor)
    for language, sentence in (("en", "nothing stood"), ("de", "stand nichts")):
        assert sentence in Messages(language).refusal(refused.value.code)


async def test_a_time_is_for_what_is_shelved_alone() -> None:
    server, actions = Server.__new__(Server), Actions()
    server._actions = actions  # type: ignore[assignment]
    seen = SimpleNamespace(is_current_event=lambda _: True, alarm=Alarm("WearLimit"))
    server._conditions = {("press-1", "WearLimit"): seen}  # type: ignore[dict-item]
    timed = (EventKind.SHELVE_TIMED, EventKind.SHELVE_ONE_SHOT)
    for event in (EventKind.ACKNOWLEDGE, EventKind.CONFIRM, EventKind.COMMENT, EventKind.UNSHELVE, *timed):
        action, actor = ConditionAction(event, b"", "seen", 1800.0), Actor("anna", Role.ENGINEER, "10.0.0.7")
        await server.act_on_condition("press-1", "WearLimit", action, actor)
    shelved = {event: shelve_s for event, shelve_s in actions.acted if shelve_s}
    assert shelved == {EventKind.SHELVE_TIMED: 1800.0, EventKind.SHELVE_ONE_SHOT: MAX_SHELVE_S}
