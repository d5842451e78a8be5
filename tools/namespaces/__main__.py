"""A cluster of network namespaces on this machine: `sudo python -m tools.namespaces`."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from aerodaas.cli.app import run_typer
from aerodaas.clock import NANOSECONDS
from aerodaas.environment.signals import raise_on_signals
from aerodaas.schedulers.lab.network import Network
from tools.namespaces.edge_cloud import EdgeCloud
from tools.namespaces.shape import Shape, parse_bandwidth, parse_time
from tools.namespaces.trace import TracePlayer

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
_console = Console(highlight=False, soft_wrap=True)


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def main(
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

        sudo python -m tools.namespaces --cloud 2 --rtt 40ms --bandwidth 50mbit
        sudo python -m tools.namespaces --trace trapezium:400 -- aerodaas run apps/farm_survey.py
    """
    shape = Shape(parse_time(rtt), parse_bandwidth(bandwidth) if bandwidth else None, loss / 100)
    network = Network.named(trace, round(period * NANOSECONDS)) if trace else None
    raise_on_signals()
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


if __name__ == "__main__":
    run_typer(app, "python -m tools.namespaces")
