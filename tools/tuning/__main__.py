"""Finds the gains of a follower by flying the simulation: `python -m tools.tuning`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.app import run_typer

if TYPE_CHECKING:
    from rich.table import Table

    from tools.tuning.search import FollowTask, Tuned

app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)


@app.command()
def follow(
    *,
    distance: Annotated[float, typer.Option(help="Metres to keep to the person.")] = 2.0,
    height: Annotated[float, typer.Option(help="Metres to fly at.")] = 1.5,
    rate: Annotated[float, typer.Option(help="Frames a second that are analysed.")] = 10.0,
    latency: Annotated[
        float, typer.Option(help="Seconds from a frame's capture to its command; see a report.")
    ] = 0.15,
    speeds: Annotated[
        str, typer.Option(help="Of the walking person, m/s, comma-separated.")
    ] = "0.4,1.0",
    duration: Annotated[float, typer.Option(help="Seconds of each walk.")] = 40.0,
    trials: Annotated[int, typer.Option(help="Gains to try.", min=1)] = 24,
    seed: Annotated[int, typer.Option(help="Of walks, gusts, noise and search.", min=0)] = 0,
    plot: Annotated[Path, typer.Option(help="Picture of before and after.")] = Path(
        "tune_follow.png"
    ),
) -> None:
    """Find the gains of a follower for your camera's rate and your latency.

    Flies after a walking person in simulation (wind, sensor noise, noisy boxes), over and over;
    the same seed gives the same gains. What is found is kept only if it is better on walks that
    the search has not seen. Prints the gains to paste into the application.

        python -m tools.tuning --rate 5 --latency 0.25
    """
    from rich.console import Console  # noqa: PLC0415 - only here
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn  # noqa: PLC0415

    from aerodaas.errors import ConfigError  # noqa: PLC0415
    from tools.tuning.plot import plot_tuned  # noqa: PLC0415
    from tools.tuning.search import FollowTask, tune_follow  # noqa: PLC0415

    try:
        walks = tuple(float(text) for text in speeds.split(","))
    except ValueError:
        raise ConfigError(f"--speeds takes numbers such as 0.4,1.0, not {speeds!r}") from None
    task = FollowTask(distance, height, rate, latency, walks, duration, seed)
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("flying", total=trials)

        def show(done: int, least: float) -> None:
            progress.update(bar, completed=done, description=f"flying, least cost {least:.3f}")

        tuned = tune_follow(task, trials=trials, progress=show)
    console.print(_table(tuned, task))
    plot.parent.mkdir(parents=True, exist_ok=True)
    plot_tuned(tuned, task, plot)
    if not tuned.better:
        console.print("Nothing better than the gains before was found; keep them.")
    else:
        console.print("Paste into the application:\n")
        gains = tuned.after
        console.print(
            "from aerodaas.following.follow_settings import FollowGains\n\n"
            f"gains = FollowGains(distance={gains.distance}, yaw={gains.yaw}, "
            f"height={gains.height})\n"
            f"follow = VipFollowAnalytics(distance={distance:g}, height={height:g}, gains=gains)\n",
            highlight=False,
            soft_wrap=True,
        )
    console.print(f"picture: {plot}", highlight=False)


def _table(tuned: Tuned, task: FollowTask) -> Table:
    """Compare before and after on the walks that judge."""
    from rich.table import Table  # noqa: PLC0415 - only here

    table = Table(title="On walks that the search has not seen", title_justify="left")
    table.add_column("gains")
    columns = ("speed m/s", "within ±0.3 m %", "nearest m", "farthest m", "height m", "in view %")
    for column in (*columns, "cost"):
        table.add_column(column, justify="right")
    for name, flown, cost in (
        ("before", tuned.flown_before, tuned.cost_before),
        ("after", tuned.flown_after, tuned.cost_after),
    ):
        for speed, one in zip(task.speeds, flown, strict=True):
            table.add_row(
                name,
                f"{speed:g}",
                f"{100 * one.within(task.distance, 0.3):.1f}",
                f"{one.distance.min():.2f}",
                f"{one.distance.max():.2f}",
                f"{one.height.min():.2f} to {one.height.max():.2f}",
                f"{100 * one.in_view.mean():.1f}",
                f"{cost:.3f}",
            )
    return table


if __name__ == "__main__":
    run_typer(app, "python -m tools.tuning")
