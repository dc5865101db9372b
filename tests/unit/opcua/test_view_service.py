"""Browse paths: what following them costs, on an address space made for it."""

import pytest
from asyncua import ua

from impactcell.opcua.address_space.node_references import set_attribute
from impactcell.opcua.asyncua_adapter import AddressSpace, NodeData
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.languages import Languages
from impactcell.opcua.services.view_service import ViewService

CHILDREN = 10


class CountedSpace(AddressSpace):
    """An address space that counts how often a node is taken from it."""

    def __init__(self) -> None:
        super().__init__()
        self.visits = 0

    def get(self, node: ua.NodeId) -> NodeData | None:
        self.visits += 1
        return super().get(node)


def reference(target: ua.NodeId, name: str) -> ua.ReferenceDescription:
    return ua.ReferenceDescription(
        ReferenceTypeId=ua.NodeId(ua.ObjectIds.Organizes), IsForward=True, NodeId=target,
        BrowseName=ua.QualifiedName(name), NodeClass=ua.NodeClass.Object,
    )  # fmt: skip


@pytest.fixture
def space() -> CountedSpace:
    """A hub whose children all have one name, and all lead back to it."""
    made = CountedSpace()
    hub, children = ua.NodeId("hub"), [ua.NodeId(f"child {n}") for n in range(CHILDREN)]
    for node in (hub, *children):
        made[node] = NodeData(node)
        set_attribute(made, node, ua.AttributeIds.NodeClass, ua.NodeClass.Object, ua.VariantType.Int32)
    for child in children:
        made[hub].references.append(reference(child, "child"))
        made[child].references.append(reference(hub, "hub"))
    return made


def path(*names: str) -> ua.BrowsePath:
    elements = [
        ua.RelativePathElement(
            ReferenceTypeId=ua.NodeId(),
            IsInverse=False,
            IncludeSubtypes=True,
            TargetName=ua.QualifiedName(name),
        )
        for name in names
    ]
    return ua.BrowsePath(StartingNode=ua.NodeId("hub"), RelativePath=ua.RelativePath(elements))


def test_a_node_is_followed_once_however_many_ways_lead_to_it(space: CountedSpace) -> None:
    """To and fro twenty-five times: followed as a tree, the paths would be 10 to the power of 25."""
    views = ViewService(space, Languages({}))
    assert views.follow(path(*("child", "hub") * 25)) == [ua.NodeId("hub")]
    assert space.visits <= 25 * (CHILDREN + 1)
    assert len(views.follow(path(*("child", "hub") * 24, "child"))) == CHILDREN


def test_a_path_that_leads_nowhere(space: CountedSpace) -> None:
    with pytest.raises(StatusCodeError) as refused:
        ViewService(space, Languages({})).follow(path("child", "child"))
    assert refused.value.code == ua.StatusCodes.BadNoMatch
