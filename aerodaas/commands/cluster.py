"""`aerodaas cluster`: an edge-cloud on this machine, and the examination of any cluster."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from aerodaas.clock import NANOSECONDS
from aerodaas.cluster.edge_cloud import EdgeCloud
from aerodaas.cluster.shape import Shape, parse_bandwidth, parse_time
from aerodaas.cluster.trace import TracePlayer
from aerodaas.schedulers.lab.network import Network
from aerodaas.signals import raise_on_termination

__all__ = ["app"]

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Edge and cloud as one cluster.

    aerodaas cluster local --cloud 2 --rtt 40ms --bandwidth 50mbit

    aerodaas cluster check 10.77.0.1:6379
""",
)
_console = Console(highlight=False, soft_wrap=True)


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def local(
    context: typer.Context,
    *,
    cloud: Annotated[int, typer.Option(help="Cloud nodes.", min=0)] = 1,
    edges: Annotated[int, typer.Option(help="Edges, this machine included.", min=1)] = 1,
    rtt: Annotated[str, typer.Option(help="Round trip to the cloud.")] = "40ms",
    bandwidth: Annotated[
        str | None, typer.Option(help="Of each cloud node's link, each way. Default: unlimited.")
    ] = None,
    loss: Annotated[float, typer.Option(help="Per cent of packets lost, each way.", min=0)] = 0.0,
    trace: Annotated[
        str | None,
        typer.Option(
            help="What the links go through, as in `aerodaas lab run --network`: `trapezium:400`, "
            "`outage:30-45`, `trace:FILE` (CSV of seconds and Mbit/s), joined by `+`."
        ),
    ] = None,
    period: Annotated[float, typer.Option(help="Seconds after which a trace repeats.")] = 300.0,
    port: Annotated[int, typer.Option(help="The head's port; 0 for a free one.", min=0)] = 0,
) -> None:
    """Bring up an edge and a cloud of network namespaces on this machine; needs root.

    This machine is the edge; each cloud node has an address, a Ray node and a shaped link of its
    own. Stays until Ctrl-C, or until the command after `--` has ended, which finds the cluster
    without --address. Whatever happens, nothing is left.

        sudo aerodaas cluster local --cloud 2 --rtt 40ms --bandwidth 50mbit
        sudo aerodaas cluster local --trace trapezium:400 -- aerodaas run apps/farm_survey.py
    """
    shape = Shape(parse_time(rtt), parse_bandwidth(bandwidth) if bandwidth else None, loss / 100)
    network = Network.named(trace, round(period * NANOSECONDS)) if trace else None
    raise_on_termination()
    with contextlib.ExitStack() as stack:
        with _console.status("starting Ray nodes"):
            cluster = stack.enter_context(EdgeCloud(cloud, edges=edges, shape=shape, port=port))
        if network is not None:
            stack.enter_context(TracePlayer(cluster, network, period))
        if context.args:
            env = {**os.environ, "RAY_ADDRESS": cluster.address}
            code = subprocess.run(context.args, env=env, check=False).returncode  # noqa: S603 - asked for
            raise typer.Exit(code)
        _show(cluster)
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait()


def _show(cluster: EdgeCloud) -> None:
    table = Table("node", "address", "round trip ms", "Mbit/s", "loss %", "enter it by", box=None)
    table.add_row("edge1", cluster.host, "", "", "", "it is this machine")
    for far in cluster.far.values():
        shape = far.shape
        rate = "unlimited" if shape.bandwidth is None else f"{shape.bandwidth / 1e6:g}"
        enter = f"nsenter -t {far.machine.pid} -n -p -m bash"
        figures = (f"{shape.rtt * 1000:g}", rate, f"{shape.loss * 100:g}")
        table.add_row(far.name, far.address, *figures, enter)
    _console.print(table)
    _console.print(f"\nfly on it:  aerodaas run apps/farm_survey.py --address {cluster.address}")
    _console.print(f"look at it: aerodaas cluster check {cluster.address}")
    _console.print("Ctrl-C takes it down.")


@app.command()
def check(
    address: Annotated[
        str, typer.Argument(help="The head's `host:port`.", envvar="RAY_ADDRESS", show_envvar=True)
    ],
) -> None:
    """Say what a cluster offers and what to mend: versions, resources, clocks, links.

    Measures round trip, bandwidth and the clocks' offset from every edge to every other node;
    takes some seconds. Ends with 1 if something needs mending.

        aerodaas cluster check 10.77.0.1:6379
    """
    from aerodaas.cluster.check import check_cluster  # noqa: PLC0415 - loads ray
    from aerodaas.doctor import show_findings  # noqa: PLC0415

    good = show_findings("aerodaas cluster check", check_cluster(address))
    raise typer.Exit(0 if good else 1)


@app.command()
def greet(address: Annotated[str, typer.Argument(help="The head's `host:port`.")]) -> None:
    """Ask a head who it is, without joining: whether it answers, our versions, our token.

    Silent if all is well. For scripts that join, such as `clusters/edge-join.sh`.

        aerodaas cluster greet 10.8.0.1:6379
    """
    from aerodaas.actors.greeting import greet as ask  # noqa: PLC0415 - loads ray

    ask(address)
