"""Whatever is done over OPC UA is written down: by whom, in which role, from where, and what came of it."""

import logging

import pytest
from asyncua import ua

from tests.opcua_server import Site, site


async def call(here: Site, user: str, owner: str, method: str, *arguments: ua.Variant) -> int:
    async with await here.client(user) as client:
        request = ua.CallMethodRequest(
            ObjectId=(await here.node(client, owner)).nodeid,
            MethodId=(await here.node(client, method)).nodeid,
            InputArguments=list(arguments),
        )
        return (await client.uaclient.call([request]))[0].StatusCode.value


@pytest.mark.slow
async def test_commands_and_acknowledgements_are_audited(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "impactcell.audit")

    def written() -> list[str]:
        lines = [r.getMessage() for r in caplog.records if r.name == "impactcell.audit"]
        caplog.clear()
        return lines

    async with site() as here:
        here.publish()
        here.raise_alarm()
        comment = ua.Variant(ua.LocalizedText("seen by me"))
        async with await here.client("observer") as client:
            known = ua.Variant(await (await here.node(client, "WearLimit/EventId")).read_value())
        written()
        acknowledge = ("WearLimit", "WearLimit/Acknowledge", known, comment)
        assert await call(here, "operator", *acknowledge) == 0
        who, what = "operator (operator) from 127.0.0.1", f"Acknowledge({known.Value.hex()}, 'seen by me')"
        assert written() == [f"{who}: press-1: WearLimit: {what}: done"]
        assert await call(here, "operator", *acknowledge) != 0
        (line,) = written()
        assert line.endswith("'seen by me'): refused, BadConditionBranchAlreadyAcked")
        assert await call(here, "observer", *acknowledge) != 0
        (line,) = written()
        assert line.startswith("observer (observer) from 127.0.0.1: press-1: WearLimit: Acknowledge(")
        assert "): refused, BadUserAccessDenied" in line, "what a role may not is not written down"
        assert await call(here, "operator", "", "StartBatch", ua.Variant("B-7"), ua.Variant(True)) == 0
        assert written() == ["operator (operator) from 127.0.0.1: press-1: StartBatch('B-7', True): done"]
        assert await call(here, "engineer", "", "SetTarget", ua.Variant(1e9)) != 0
        assert "SetTarget(1000000000.0): refused, BadInvalidArgument Target: Bad" in written()[0]
        assert await call(here, "engineer", "", "ResetWear", ua.Variant("new plate")) != 0
        told = "ResetWear('new plate'): refused, BadInvalidArgument Comment is a String, not a LocalizedText"
        assert written()[0].endswith(told)
        assert await call(here, "engineer", "", "ResetWear", ua.Variant(ua.LocalizedText("x" * 999))) == 0
        assert "x" * 150 in (line := written()[0])
        assert len(line) < 400
        assert await call(here, "engineer", "Wear", "ResetWear", comment) != 0
        assert "refused, BadMethodInvalid" in written()[0]


async def test_a_refresh_is_no_act(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "impactcell.audit")
    async with site() as here, await here.client("observer") as client:
        request = ua.CallMethodRequest(
            ObjectId=ua.NodeId(ua.ObjectIds.ConditionType),
            MethodId=ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh),
            InputArguments=[ua.Variant(1, ua.VariantType.UInt32)],
        )
        await client.uaclient.call([request])
    assert [r for r in caplog.records if r.name == "impactcell.audit"] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made_up", "arguments"),
    [
        ("no\nengineer (engineer) from 10.0.0.9: press-1: ResetWear('new tool'): done", []),
        ("\x1b[2Jno", ["a\r\nb"]),
        ("x" * 4000, [list(range(20_000))]),
        ("no", [["y" * 4000] * 40]),
        ("no", [b"z" * 20_000]),
        ("no", [1] * 500),
    ],
    ids=["lines", "escapes", "long names", "long lists", "long texts in lists", "many arguments"],
)
async def test_whatever_a_client_makes_up_is_one_short_line(
    made_up: str, arguments: list[object], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "impactcell.audit")
    async with site() as here, await here.client("observer") as client:
        request = ua.CallMethodRequest(
            ObjectId=ua.NodeId(made_up, 2),
            MethodId=ua.NodeId(f"{made_up} too", 2),
            InputArguments=[ua.Variant(argument) for argument in arguments],
        )
        (result,) = await client.uaclient.call([request])
    assert not result.StatusCode.is_good()
    (line,) = (r.getMessage() for r in caplog.records if r.name == "impactcell.audit")
    assert line.isprintable()
    assert line.startswith("observer (observer) from 127.0.0.1: ")
    assert len(line) < 3000
