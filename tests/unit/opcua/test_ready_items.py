"""What goes into one message, by the limit that the subscription has."""

from types import SimpleNamespace
from typing import Any

from impactcell.opcua.subscriptions.ready_items import ReadyItems


def ready(*waiting: int) -> ReadyItems:
    items = ReadyItems()
    for number, count in enumerate(waiting):
        item: Any = SimpleNamespace(id=number, waiting=count)
        items.add(item)
    return items


def test_one_message_is_as_long_as_the_subscription_has_it() -> None:
    # MaxNotificationsPerPublish of 10 and 150 waiting are fifteen messages (Part 4, 5.14.2).
    assert not ready(150).fit_one_message(10)
    assert not ready(*[1] * 11).fit_one_message(10)
    assert ready(4, 6).fit_one_message(10)
    assert not ready(4, 7).fit_one_message(10)
    assert ready().fit_one_message(1)
