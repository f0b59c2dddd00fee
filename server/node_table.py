"""The nodes of a scene by the names a lab gives them: what a frame does not draw is hidden."""

from collections import Counter
from collections.abc import Callable

from server.nodes import Node


class NodeTable:
    """All nodes made, and which of them this frame draws."""

    def __init__(self) -> None:
        self._nodes: dict[str, Node] = {}
        self._drawn: dict[str, None] = {}  # in the order drawn
        self._made: Counter[str] = Counter()

    def __getitem__(self, name: str) -> Node:
        return self._nodes[name]

    def node(self, name: str, appearance: object, make: Callable[[str], Node]) -> Node:
        """The node of this name, made anew where it must look different; under a path of its own
        then: a viewer may go on with the pose of a removed node of the same path."""
        node = self._nodes.get(name)
        if node is None or node.appearance != appearance:
            if node is not None:
                node.remove()
            number, self._made[name] = self._made[name], self._made[name] + 1
            node = self._nodes[name] = make(f"/{name}#{number}" if number else f"/{name}")
            node.appearance = appearance
        self._drawn[name] = None
        return node

    def end_frame(self) -> list[Node]:
        """Ends a frame: hides what it did not ask for. Those it did, in that order."""
        for name, node in self._nodes.items():
            node.set_visible(name in self._drawn)
        drawn = [self._nodes[name] for name in self._drawn]
        self._drawn.clear()
        return drawn

    def clear(self) -> None:
        """Removes all nodes."""
        for node in self._nodes.values():
            node.remove()
        self._nodes.clear()
        self._drawn.clear()
