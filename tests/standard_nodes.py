"""The standard address space, built once in a process and copied for each server of a test."""

from asyncua.server.address_space import AttributeValue, NodeData
from asyncua.server.internal_server import InternalServer

_build = InternalServer.load_standard_address_space
_nodes: dict[object, NodeData] = {}


def _copy(node: NodeData) -> NodeData:
    """Copy what a server changes of a node: the lists and tables, not what is in them."""
    copy = NodeData(node.nodeid)
    copy.attributes = {attribute: AttributeValue(held.value) for attribute, held in node.attributes.items()}
    copy.references = list(node.references)
    return copy


async def load(server: InternalServer, shelf_file: object = None) -> None:
    """Take the place of what builds the nodes one by one, which takes half a second."""
    assert shelf_file is None
    if not _nodes:
        await _build(server)
        assert not any(
            node.call or held.value_callback or held.value_setter
            for node in server.aspace._nodes.values()
            for held in node.attributes.values()
        )
        _nodes.update({name: _copy(node) for name, node in server.aspace._nodes.items()})
    else:
        server.aspace._nodes.update({name: _copy(node) for name, node in _nodes.items()})
