"""A session that moves to another channel while a Publish request of the one before is looked at."""

from types import SimpleNamespace

import pytest
from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.languages import Languages
from impactcell.opcua.sessions.session_table import Session
from impactcell.opcua.subscriptions.subscription_service import SubscriptionService


async def test_a_publish_request_that_the_move_has_overtaken_is_refused_where_it_came_from() -> None:
    before, after = object(), object()
    session = Session(ua.NodeId(), ua.NodeId(), "", before, "", None, 10.0)  # type: ignore[arg-type]
    service = SubscriptionService(ServerLimits(), Languages({}))
    service._subscriptions[1] = SimpleNamespace(session=session)  # type: ignore[assignment]

    class Share:
        async def each(self, items: object, _work: object) -> list[int]:
            session.attach(after)  # type: ignore[arg-type]  # many acknowledgements take turns
            return [0 for _ in items]  # type: ignore[attr-defined]

    context = SimpleNamespace(
        session=session, connection=before, share=Share(), request_id=7, header=ua.RequestHeader()
    )
    with pytest.raises(StatusCodeError) as refused:
        await service.publish(context, ua.PublishParameters())  # type: ignore[arg-type]
    assert refused.value.code == ua.StatusCodes.BadSecureChannelIdInvalid
    assert not session.publish_requests


def test_requests_stay_where_the_session_does() -> None:
    here = object()
    session = Session(ua.NodeId(), ua.NodeId(), "", here, "", None, 10.0)  # type: ignore[arg-type]
    session.publish_requests.append(SimpleNamespace())  # type: ignore[arg-type]
    session.attach(here)  # type: ignore[arg-type]
    assert session.publish_requests
    session.attach(None)
    assert not session.publish_requests
