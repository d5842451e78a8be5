"""Plot of processor and memory use over time."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.palette import OKABE_ITO
from aerodaas.recording.report.plots.style import CYCLE, grid, legend, new_figure

__all__ = ["loads_figure"]

_MOST_LINES = 10


def loads_figure(flight: RecordedFlight) -> Figure:
    """Cores and memory of the ten busiest actors over mission time, with machines and GPUs."""
    figure = new_figure(4.6)
    cores, memory = figure.subplots(2, 1, sharex=True)
    busiest = sorted(flight.loads, key=lambda name: -sum(flight.loads[name].cpu))[:_MOST_LINES]
    lines: list[Artist] = []
    for name, (colour, style) in zip(busiest, CYCLE, strict=False):
        load = flight.loads[name]
        (line,) = cores.plot(load.time, load.cpu, style, color=colour, label=name)
        memory.plot(load.time, load.memory, style, color=colour)
        lines.append(line)
    share = cores.twinx()
    for number, (name, machine) in enumerate(flight.machines.items()):
        label = f"machine {name}" if len(flight.machines) > 1 else "whole machine"
        (line,) = share.plot(
            machine.time,
            [100 * cpu for cpu in machine.cpu],
            color=OKABE_ITO["grey"],
            linestyle=("-", "--", ":")[number % 3],
            linewidth=1.2,
            label=f"{label} (right)",
        )
        lines.append(line)
    for number, (name, gpu) in enumerate(flight.gpus.items()):
        (line,) = share.plot(
            gpu.time,
            [100 * busy for busy in gpu.cpu],
            color="black",
            linestyle=("-.", ":", "--")[number % 3],
            linewidth=1.2,
            label=f"GPU {name if len(flight.machines) > 1 else name.rpartition(' ')[2]} (right)",
        )
        lines.append(line)
    share.set(ylim=(0, 105), ylabel="Whole machine (%)")
    share.set_zorder(cores.get_zorder() - 1)
    cores.patch.set_visible(False)
    cores.set(ylabel="Processor (cores)")
    memory.set(ylabel="Memory (MB)", xlabel="Mission time (s)")
    for axes in (cores, memory):
        # From zero, with room above a line that hardly changes.
        axes.set_ylim(0, 1.1 * axes.get_ylim()[1])
        grid(axes, "y")
    legend(figure, lines)
    return figure
