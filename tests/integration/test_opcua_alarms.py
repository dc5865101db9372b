"""Events of alarms: when one is sent, and for how long its EventId stands for the alarm."""

import asyncio
import time
from dataclasses import replace
from pathlib import Path

import pytest
from asyncua import Client, ua

from impactcell.alarms import (
    RULES,
    AlarmEvent,
    AlarmSettings,
    EventKind,
    Message,
    RuleResult,
    apply_event,
    apply_rule_result,
    initial_state,
)
from impactcell.alarms.rules import module_connection, positioning_fault
from impactcell.records import Alarm, Evidence, Shelving
from tests.opcua_server import CELL, Site, site
from tests.patience import PATIENCE_S

codes = ua.StatusCodes


class Events:
    """Collects the events of a cell."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[object] = asyncio.Queue()

    def event_notification(self, event: object) -> None:
        self.queue.put_nowait(event)

    async def next(self) -> object:
        return await asyncio.wait_for(self.queue.get(), PATIENCE_S)


async def listening(here: Site, client: Client) -> Events:
    events = Events()
    subscription = await client.create_subscription(10, events)
    kind = ua.NodeId(1002, await client.get_namespace_index("urn:impactcell:ua"))
    await subscription.subscribe_events(
        await here.node(client, ""), client.get_node(kind), where_clause_generation=False
    )
    return events


async def act(here: Site, client: Client, method: str, event_id: bytes, comment: str = "seen") -> int:
    request = ua.CallMethodRequest(
        ObjectId=(await here.node(client, "WearLimit")).nodeid,
        MethodId=(await here.node(client, f"WearLimit/{method}")).nodeid,
        InputArguments=[
            ua.Variant(event_id, ua.VariantType.ByteString),
            ua.Variant(ua.LocalizedText(comment)),
        ],
    )
    return (await client.uaclient.call([request]))[0].StatusCode.value


@pytest.mark.slow
async def test_an_alarm_that_stands_sends_no_event_a_cycle() -> None:
    """Active and acknowledged: only a step of what it watches, and another severity, are told."""
    wear = RULES["WearLimit"].settings
    settings = AlarmSettings()
    state = initial_state(settings)

    def cycle(size: float, number: int) -> Alarm:
        nonlocal state
        evidence = Evidence(statistic=0.99, threshold=0.98, size=size, size_std=0.002)
        result = RuleResult("WearLimit", True, Message(f"by {size}", f"um {size}"), evidence)
        state = apply_rule_result(settings, state, result, number, number * 10**9)[0]
        return state.alarm("WearLimit")

    async with site() as here, await here.client("operator") as client:
        events = await listening(here, client)
        number = 0
        while not (alarm := cycle(0.01, number)).active:
            number += 1
        here.actions.alarms[CELL, "WearLimit"] = alarm
        here.server.alarm(CELL, alarm)
        raised = await events.next()
        assert await act(here, client, "Acknowledge", raised.EventId) == 0
        acknowledged = await events.next()
        state = apply_event(state, "WearLimit", AlarmEvent(EventKind.ACKNOWLEDGE, number, 10**9))[0]
        state = replace(state, alarms=tuple(_as(here, a) for a in state.alarms))
        for step in range(24):
            here.server.alarm(CELL, cycle(0.01 + 0.0001 * (step % 7), number + step))
        here.server.alarm(CELL, cycle(0.01 + 1.1 * wear.told_step * 0.002, number + 24))
        step = await events.next()
        assert step.Size == pytest.approx(0.0122), "one of the 24 cycles was told"
        assert step.Message.Text == "by 0.0122"
        assert step.Time > acknowledged.Time
        here.server.alarm(CELL, replace(state.alarm("WearLimit"), severity=800))
        severe = await events.next()
        assert severe.Severity == 800
        assert len({e.EventId for e in (raised, acknowledged, step, severe)}) == 4
        assert events.queue.empty()
        for event in (raised, acknowledged, step):
            assert await act(here, client, "Confirm", event.EventId) in {
                0,
                codes.BadConditionBranchAlreadyConfirmed,
            }


def _as(here: Site, alarm: Alarm) -> Alarm:
    """The alarm as the server has it after a person's action."""
    return here.actions.alarms.get((CELL, alarm.name), alarm)


@pytest.mark.slow
async def test_an_event_id_stands_for_its_activation_however_much_came_after() -> None:
    async with site() as here, await here.client("operator") as client:
        events = await listening(here, client)
        here.raise_alarm()
        first = (await events.next()).EventId
        for _ in range(150):
            assert await act(here, client, "AddComment", first) == 0
        assert await act(here, client, "Acknowledge", first) == 0
        assert await act(here, client, "Confirm", first) == 0


async def test_an_event_id_does_not_stand_for_another_activation() -> None:
    async with site() as here, await here.client("operator") as client:
        events = await listening(here, client)
        here.raise_alarm()
        first = (await events.next()).EventId
        here.clear_alarm()
        cleared = (await events.next()).EventId
        here.raise_alarm()
        again = (await events.next()).EventId
        for old in (first, cleared, bytes(16), b"", again[:8], again + b"x"):
            assert await act(here, client, "Acknowledge", old) == codes.BadEventIdUnknown, old.hex()
        assert await act(here, client, "Acknowledge", again) == 0


async def test_another_reason_of_a_standing_alarm_is_an_event_and_the_next_fault_calls() -> None:
    """A changed message without figures was told to nobody."""
    settings = AlarmSettings()
    state = initial_state(settings)
    async with site() as here, await here.client("operator") as client:
        events = await listening(here, client)

        async def told(result: RuleResult, number: int) -> object:
            nonlocal state
            state = apply_rule_result(settings, state, result, 0, number * 10**9)[0]
            here.server.alarm(CELL, state.alarm(result.name))
            return await events.next()

        async def acknowledged(name: str) -> None:
            nonlocal state
            state = apply_event(state, name, AlarmEvent(EventKind.ACKNOWLEDGE, 0, 2 * 10**9))[0]
            here.server.alarm(CELL, state.alarm(name))
            assert (await events.next()).AckedState.Text == "Acknowledged"

        await told(module_connection.result("p: connection lost", connected=False), 1)
        await acknowledged("ModuleConnection")
        link = await told(module_connection.result("p: not connected", connected=False), 3)
        assert "not connected" in link.Message.Text
        assert link.AckedState.Text == "Acknowledged"
        first = await told(positioning_fault.result("p: the target is refused"), 1)
        await acknowledged("PositioningFault")
        task = await told(positioning_fault.result("p: the mass is not known"), 3)
        assert "mass is not known" in task.Message.Text
        assert task.AckedState.Text == "Unacknowledged"
        assert task.EventId[:8] != first.EventId[:8], "what stands for one fault stands for the next"
        assert events.queue.empty()


@pytest.mark.slow
async def test_a_comment_that_is_no_utf_8_is_refused() -> None:
    """What a client sends in Latin-1 came through with half characters, which the journal cannot write."""
    latin = b"gr\xfc\xdfe".decode(errors="surrogateescape")  # the client sends these very bytes
    async with site() as here, await here.client("engineer") as client:
        events = await listening(here, client)
        here.raise_alarm()
        raised = (await events.next()).EventId
        for method in ("AddComment", "Acknowledge", "Confirm"):
            assert await act(here, client, method, raised, latin) == codes.BadInvalidArgument, method
            assert here.actions.of(CELL, "WearLimit").comment == ""
        reset = ua.CallMethodRequest(
            ObjectId=(await here.node(client, "")).nodeid,
            MethodId=(await here.node(client, "ResetWear")).nodeid,
            InputArguments=[ua.Variant(ua.LocalizedText(latin))],
        )
        (result,) = await client.uaclient.call([reset])
        assert result.StatusCode.value == codes.BadInvalidArgument
        assert result.InputArgumentResults[0].value == codes.BadOutOfRange
        assert here.actions.calls == []
        assert await act(here, client, "Acknowledge", raised, "grüße") == 0


async def test_a_comment_without_a_text_is_refused_and_changes_nothing() -> None:
    async with site() as here, await here.client("engineer") as client:
        events = await listening(here, client)
        raised = here.raise_alarm()
        shown = (await events.next()).EventId
        assert await act(here, client, "AddComment", shown, "") == codes.BadInvalidArgument
        assert here.actions.of(CELL, "WearLimit") == raised
        assert await act(here, client, "Acknowledge", shown, "") == 0


@pytest.mark.slow
@pytest.mark.parametrize("action", ["Acknowledge", "AddComment"])
async def test_an_event_id_holds_over_a_restart(tmp_path: Path, action: str) -> None:
    """Not only the newest: a client that was offline acts on the event it has."""
    async with site(directory=tmp_path) as here, await here.client("operator") as client:
        events = await listening(here, client)
        here.raise_alarm()
        first = (await events.next()).EventId
        assert await act(here, client, "AddComment", first) == 0
        stored = here.actions.of(CELL, "WearLimit")
    async with site(directory=tmp_path) as here:
        here.actions.alarms[CELL, "WearLimit"] = stored
        here.server.alarm(CELL, stored)
        async with await here.client("operator") as client:
            assert await act(here, client, action, first) == 0


@pytest.mark.slow
async def test_the_history_tells_the_same_event_ids() -> None:
    async with site() as here, await here.client("operator") as client:
        events = await listening(here, client)
        here.history.transitions[CELL] = [here.raise_alarm(), here.clear_alarm()]
        live = [(await events.next()).EventId for _ in range(2)]
        node = await here.node(client, "")
        past = await node.read_event_history(
            starttime=ua.win_epoch_to_datetime(1 << 56), numvalues=5,
            evtypes=client.get_node(ua.ObjectIds.AlarmConditionType),
        )  # fmt: skip
        assert [event.EventId for event in past] == live


async def test_a_comment_stands_as_its_authors_while_others_act_without_one() -> None:
    """OPC 10000-9: a NULL comment changes none (5.7.3), ClientUserId is whose the last one is (5.5.2)."""
    async with site() as here, await here.client("operator") as ann, await here.client("engineer") as bob:
        events = await listening(here, ann)
        here.raise_alarm()
        raised = (await events.next()).EventId
        assert await act(here, bob, "Acknowledge", raised, "") == 0
        silent = await events.next()
        assert (silent.Comment.Text or "", silent.ClientUserId) == ("", "engineer"), "nobody else spoke"
        assert await act(here, ann, "AddComment", raised, "seen") == 0
        noted = await events.next()
        assert await act(here, bob, "Confirm", raised, "") == 0
        confirmed = await events.next()
        for event in (noted, confirmed):
            assert (event.Comment.Text, event.ClientUserId) == ("seen", "operator")
        assert getattr(confirmed, "Comment/SourceTimestamp") == noted.Time


async def past(here: Site, client: Client, alarm: Alarm) -> object:
    """The event of the history that tells a transition."""
    here.history.transitions[CELL] = [alarm]
    (event,) = await (await here.node(client, "")).read_event_history(
        starttime=ua.win_epoch_to_datetime(1 << 56), numvalues=5,
        evtypes=client.get_node(ua.ObjectIds.AlarmConditionType),
    )  # fmt: skip
    return event


async def test_an_event_of_the_past_tells_how_long_it_was_shelved_for() -> None:
    """It was as long as was left when it was read: 0 of all that have ended."""
    shelved = Alarm(
        "WearLimit", shelving=Shelving.TIMED, time_ns=10**18, shelved_until_ns=10**18 + 90 * 10**9
    )
    async with site() as here, await here.client("operator") as client:
        event = await past(here, client, shelved)
        assert getattr(event, "ShelvingState/UnshelveTime") == 90_000.0


async def read(here: Site, client: Client, path: str) -> ua.DataValue:
    return await (await here.node(client, f"WearLimit/{path}")).read_data_value()


async def test_the_last_severity_is_that_before_the_last_change_of_it() -> None:
    """OPC 10000-9, 5.5.2: it is 0 at first, and a value only after a change of severity."""
    async with site() as here, await here.client("operator") as client:
        now_ns = time.time_ns()
        raised = Alarm("WearLimit", active=True, acknowledged=False, time_ns=now_ns, activation=now_ns)
        severe = replace(raised, severity=800, time_ns=now_ns + 10**6)
        commented = replace(severe, comment="seen", time_ns=now_ns + 2 * 10**6)
        events = await listening(here, client)
        here.server.alarm(CELL, replace(raised, active=False, time_ns=0))
        told = [await events.next()]
        for alarm in (raised, severe, commented):
            here.server.alarm(CELL, alarm)
            told.append(await events.next())
        assert [event.LastSeverity for event in told] == [0, 0, 500, 500]
        since = [getattr(event, "LastSeverity/SourceTimestamp") for event in told]
        assert since[0] == since[1]
        assert since[2] == since[3] == told[2].Time
        node = await read(here, client, "LastSeverity")
        assert (node.Value.Value, node.SourceTimestamp) == (500, told[2].Time)
        assert (await past(here, client, raised)).LastSeverity == 0


@pytest.mark.slow
async def test_a_state_tells_since_when_it_is(tmp_path: Path) -> None:
    """OPC 10000-9: TransitionTime is when the state was entered, SourceTimestamp when the value changed."""
    async with site(directory=tmp_path) as here, await here.client("engineer") as client:
        events = await listening(here, client)

        async def since(*paths: str) -> list[object]:
            return [(await read(here, client, path)).Value.Value for path in paths]

        states = ("ActiveState/TransitionTime", "EnabledState/TransitionTime")
        values = ("Comment/SourceTimestamp", "Quality/SourceTimestamp")
        here.raise_alarm()
        raised = await events.next()
        active, enabled, comment, quality = await since(*states, *values)
        assert active == raised.Time
        assert enabled < raised.Time
        assert await act(here, client, "AddComment", raised.EventId) == 0
        commented = await events.next()
        assert await act(here, client, "Acknowledge", raised.EventId, "") == 0
        acknowledged = await events.next()
        here.server.alarm(CELL, replace(here.actions.of(CELL, "WearLimit"), evidence=Evidence(size=0.02)))
        renewed = await events.next()
        expected = [raised.Time, enabled, commented.Time, quality]
        assert await since(*states, *values) == expected
        sent = [getattr(acknowledged, path) for path in (*states, *values)]
        assert sent == expected
        assert renewed.Time > acknowledged.Time > commented.Time > comment
        for path in values:
            variable = await read(here, client, path.partition("/")[0])
            assert [variable.SourceTimestamp] == await since(path)

        here.clear_alarm()
        cleared = await events.next()
        assert await act(here, client, "Confirm", raised.EventId, "") == 0
        assert await since(*states, *values) == [cleared.Time, enabled, commented.Time, quality]
        confirmed = await past(here, client, here.actions.of(CELL, "WearLimit"))
        assert getattr(confirmed, states[0]) == cleared.Time
        stored = here.actions.of(CELL, "WearLimit")
    async with site(directory=tmp_path) as here:
        here.server.alarm(CELL, stored)
        async with await here.client("engineer") as client:
            times = [(await read(here, client, path)).Value.Value for path in (*states, *values)]
            assert times[0] == cleared.Time
            assert times[2] == commented.Time
