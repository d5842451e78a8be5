"""The graph of an application as a picture: a Mermaid flowchart."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from aerodaas.dataflow.graph import Graph, NavigationEdge, Node, Trigger

__all__ = ["mermaid"]

_UNPLACED = "beside the drone"
"""Where an analysis runs that the application has not deployed."""


def mermaid(graph: Graph) -> str:
    """Draw sensors by robot, analyses by where they run, and what flows from where to where.

    Thin arrows are streams with the type of their items, thick ones navigation, dotted ones
    triggers. Sites that show Markdown, such as GitHub's and JupyterLab, draw the text.
    """
    names = {node: f"n{number}" for number, node in enumerate(graph.nodes)}
    robots = {robot: f"r{number}" for number, robot in enumerate(_commanded(graph))}
    lines = ["flowchart LR"]
    for number, (title, nodes) in enumerate(_groups(graph).items()):
        lines.append(f"    subgraph g{number}[{_quoted(title)}]")
        lines += [f"        {names[node.id]}{_shape(node)}" for node in nodes]
        lines.append("    end")
    lines += [f"    {name}{{{{{_quoted(f'{robot} flies')}}}}}" for robot, name in robots.items()]
    for node in graph.nodes.values():
        for source in node.inputs:
            item = graph.nodes[source].item.__name__
            lines.append(f"    {names[source]} -->|{_quoted(item)}| {names[node.id]}")
        lines += [f"    {names[node.id]} {_drawn(one, names, robots)}" for one in node.triggers]
    for number, edge in enumerate(graph.navigation):
        lines += [f"    {line}" for line in _navigation(edge, f"w{number}", names, robots)]
    return "\n".join(lines) + "\n"


def _commanded(graph: Graph) -> dict[str, None]:
    """The robots that something navigates or calls, in order."""
    navigated = [edge.robot for edge in graph.navigation]
    triggers = [one for node in graph.nodes.values() for one in node.triggers]
    return dict.fromkeys([*navigated, *(one.target for one in triggers if one.method is not None)])


def _groups(graph: Graph) -> dict[str, list[Node]]:
    groups: dict[str, list[Node]] = defaultdict(list)
    for node in graph.nodes.values():
        sensors = f"sensors of {node.robot}" if node.robot else "sensors"
        groups[sensors if node.kind == "sensor" else node.compute or _UNPLACED].append(node)
    return groups


def _shape(node: Node) -> str:
    if node.kind == "sensor":
        return f"([{_quoted(node.id)}])"
    asleep = " (until it is triggered)" if node.dormant else ""
    return f"[{_quoted(f'{node.id}<br/>{type(node.work).__name__}{asleep}')}]"


def _drawn(trigger: Trigger, names: dict[str, str], robots: dict[str, str]) -> str:
    if trigger.method is None:
        return f"-.->|wakes| {names[trigger.target]}"
    return f"-.->|{_quoted(trigger.method)}| {robots[trigger.target]}"


def _navigation(
    edge: NavigationEdge, name: str, names: dict[str, str], robots: dict[str, str]
) -> Iterator[str]:
    stream = edge.navigation.stream
    if stream is not None:
        yield f"{names[stream.name]} ==>|navigates| {robots[edge.robot]}"
        return
    count = len(edge.navigation.waypoints)
    yield f"{name}[/{_quoted(f'{count} waypoint' + 's' * (count != 1))}/] ==> {robots[edge.robot]}"


def _quoted(text: str) -> str:
    return '"' + text.replace("&", "#amp;").replace('"', "#quot;") + '"'
