"""The check of a mission document, as tables or as JSON."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from aerodaas.config.options import RunOptions
from aerodaas.dataflow.mission_document import read_mission
from aerodaas.documents.checking import check_document
from aerodaas.environment.document.flying import built_document, environment_of
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.proposals import CheckReport, Finding, RobotForecast

__all__ = ["check_file"]


def check_file(path: Path, options: RunOptions, *, as_json: bool) -> bool:
    """Check a mission document and print the report; True if nothing was found.

    Args:
        path: The file.
        options: Of the run; its environment file goes before the one that the document names.
        as_json: Print it for programs.

    Raises:
        ConfigError: For a malformed document, and without an environment.
    """
    document = read_mission(path)
    report = check_document(document, environment_of(document, path, options).config)
    if report.passed:
        # Making the analyses tells what their settings alone do not, such as a missing model.
        try:
            built_document(document, path, options)
        except AeroDaaSError as error:
            text = str(error).removeprefix(f"{path}: ")
            finding = Finding(check="document", text=text, remedy="mend this part of the document")
            report = report.model_copy(update={"passed": False, "findings": [finding]})
    if as_json:
        typer.echo(report.model_dump_json())
    else:
        _show(path, report)
    return report.passed


def _show(path: Path, report: CheckReport) -> None:
    found = len(report.findings)
    result = f"{found} {'finding' if found == 1 else 'findings'}" if found else "nothing found"
    title = Text(f"aerodaas check {path.name}: {result}")
    table = Table("check", "finding", title=title, title_justify="left", box=None, pad_edge=False)
    for one in report.findings:
        remedy = Text(f" → {one.remedy}", "yellow")
        table.add_row(Text(one.check.replace("_", " "), "red"), Text.assemble(one.text, remedy))
    console = Console()
    console.print(table if found else title)
    columns = ("robot", "waypoints", "way", "time", "charge used", "highest")
    forecasts = Table(*columns, box=None, pad_edge=False)
    for one in report.forecasts:
        forecasts.add_row(one.robot, str(one.waypoints), *_figures(one))
    if report.forecasts:
        console.print(forecasts)


def _figures(forecast: RobotForecast) -> tuple[str, str, str, str]:
    """Figures of a forecast; a way that an analysis decides has none."""

    def figure(value: float | None, unit: str, scale: float = 1.0) -> str:
        return "as flown" if value is None else f"{scale * value:.0f} {unit}"

    return (
        figure(forecast.distance, "m"),
        figure(forecast.seconds, "s"),
        figure(forecast.battery_used, "%", 100.0),
        "" if forecast.highest is None else f"{forecast.highest:.1f} m",
    )
