"""Names, descriptions, states and alarms in the language that a session asks for."""

import asyncio
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from asyncua import Client, ua

from impactcell.opcua.languages import Languages, TranslatedText
from impactcell.records import Alarm
from impactcell.scada.german import GERMAN
from tests.opcua_server import CELL, START_NS, Site, site

pytestmark = pytest.mark.asyncio(loop_scope="module")
LANGUAGES = Languages({"de": GERMAN})


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def here() -> AsyncIterator[Site]:
    async with site() as running:
        running.publish()
        yield running


async def speaking(here: Site, *locale_ids: str) -> Client:
    """Connect a client that asks for languages."""
    client = await here.client()
    client._locale = list(locale_ids)
    return client


async def attribute(here: Site, client: Client, path: str, attribute_id: ua.AttributeIds) -> ua.LocalizedText:
    node = await here.node(client, path)
    return (await node.read_attribute(attribute_id)).Value.Value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("locale_ids", "locale", "text"),
    [
        ((), None, "StaticFriction"),
        (("de",), "de", "Haftreibung µs"),
        (("de-AT", "en"), "de", "Haftreibung µs"),
        (("fr", "de"), "de", "Haftreibung µs"),
        (("en-US", "de"), "en", "StaticFriction"),
        (("fr",), None, "StaticFriction"),
    ],
)
async def test_the_first_language_that_is_spoken(
    here: Site, locale_ids: tuple[str, ...], locale: str | None, text: str
) -> None:
    async with await speaking(here, *locale_ids) as client:
        name = await attribute(here, client, "Friction/StaticFriction", ua.AttributeIds.DisplayName)
        assert (name.Locale, name.Text) == (locale, text)


@pytest.mark.slow
async def test_two_sessions_two_languages(here: Site) -> None:
    async with await speaking(here, "de") as german, await speaking(here, "en") as english:
        state = "WearLimit/EnabledState"
        texts = [(await (await here.node(c, state)).read_value()).Text for c in (german, english, german)]
        assert texts == ["Eingeschaltet", "Enabled", "Eingeschaltet"]
        index = await german.get_namespace_index("urn:impactcell:cells")
        found = []
        for client in (german, english):
            parameters = ua.BrowseParameters()
            parameters.NodesToBrowse = [
                ua.BrowseDescription(NodeId=ua.NodeId(CELL, index), ResultMask=63, NodeClassMask=4)
            ]
            result = (await client.uaclient.browse(parameters))[0]
            found.append({r.BrowseName.Name: r.DisplayName.Text for r in result.References})
        assert found[0]["StartBatch"] == "Charge beginnen"
        assert found[1]["StartBatch"] == "StartBatch"


@pytest.mark.slow
async def test_the_languages_are_listed(here: Site) -> None:
    async with await here.client() as client:
        node = client.get_node(ua.ObjectIds.Server_ServerCapabilities_LocaleIdArray)
        assert await node.read_value() == ["en", "de"]


class Heard:
    def __init__(self) -> None:
        self.events: asyncio.Queue[object] = asyncio.Queue()
        self.values: asyncio.Queue[object] = asyncio.Queue()

    def event_notification(self, event: object) -> None:
        self.events.put_nowait(event)

    def datachange_notification(self, _node: object, value: object, _data: object) -> None:
        self.values.put_nowait(value)


@pytest.mark.slow
async def test_alarms_are_told_in_the_language_of_the_listener(here: Site) -> None:
    message = "Die Oberfläche ist verschlissen."
    async with await speaking(here, "de") as german, await speaking(here, "en") as english:
        heard = []
        for client in (german, english):
            listener = Heard()
            subscription = await client.create_subscription(10.0, listener)
            await subscription.subscribe_events(await here.node(client, ""), ua.ObjectIds.AlarmConditionType)
            await subscription.subscribe_data_change(await here.node(client, "WearLimit/ActiveState"))
            heard.append(listener)
        assert [(await h.values.get()).Text for h in heard] == ["Nicht aktiv", "Inactive"]
        here.raise_alarm(message="The surface is worn.", german=message)
        events = [await h.events.get() for h in heard]
        assert [(e.Message.Locale, e.Message.Text) for e in events] == [
            ("de", message),
            ("en", "The surface is worn."),
        ]
        assert [(await h.values.get()).Text for h in heard] == ["Aktiv", "Active"]


@pytest.mark.slow
async def test_the_past_is_told_in_the_language_of_who_asks(here: Site) -> None:
    here.history.transitions[CELL] = [
        Alarm(
            "WearLimit", active=True, cycle=1, time_ns=START_NS, message="Worn.", message_de="Verschlissen."
        )
    ]
    field = ua.SimpleAttributeOperand(
        ua.NodeId(ua.ObjectIds.BaseEventType), [ua.QualifiedName("Message", 0)], ua.AttributeIds.Value
    )
    details = ua.ReadEventDetails(
        NumValuesPerNode=1, StartTime=ua.get_win_epoch().replace(year=2020), EndTime=ua.get_win_epoch(),
        Filter=ua.EventFilter(SelectClauses=[field]),
    )  # fmt: skip
    async with await speaking(here, "de") as client:
        parameters = ua.HistoryReadParameters(
            HistoryReadDetails=details, TimestampsToReturn=ua.TimestampsToReturn.Source,
            ReleaseContinuationPoints=False,
            NodesToRead=[ua.HistoryReadValueId(NodeId=(await here.node(client, "")).nodeid)],
        )  # fmt: skip
        result = (await client.uaclient.history_read(parameters))[0]
        text = result.HistoryData.Events[0].EventFields[0].Value
        assert (text.Locale, text.Text) == ("de", "Verschlissen.")


@pytest.mark.slow
async def test_every_name_and_description_of_a_cell_is_there_in_german(here: Site) -> None:
    """Names of the nodes of a cell, of its types' methods, and all that says what they are; none is empty."""
    missing, empty = set(), set()
    for node, data in here.server._host._space._nodes.items():
        if not str(node.Identifier).startswith(CELL):
            continue
        for attribute_id in (ua.AttributeIds.DisplayName, ua.AttributeIds.Description):
            text = data.attributes[attribute_id].value.Value.Value
            if not text.Text or text.Text == "-":
                empty.add((str(node.Identifier), attribute_id.name))
            if text.Text != CELL and LANGUAGES.text(text, "de").Locale != "de":
                missing.add(text.Text)
    assert not missing, "say it in impactcell/scada/german_descriptions.py: " + "; ".join(sorted(missing))
    assert not empty


async def test_a_text_without_a_translation_stays_as_it_is() -> None:
    unknown = ua.LocalizedText("operator's own words")
    assert LANGUAGES.text(unknown, "de") is unknown
    assert LANGUAGES.text(TranslatedText("a", de="b"), "de").Text == "b"
