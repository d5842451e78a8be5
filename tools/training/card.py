"""Model cards: what a model is, what it was trained on, and how well it does."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["Card", "write_card"]

_NOTES = "## Notes"


@dataclass
class Card:
    """What goes into a card."""

    title: str
    purpose: str
    recipe: dict[str, str] = field(default_factory=dict)
    figures: dict[str, str] = field(default_factory=dict)


def write_card(card: Card, path: Path) -> None:
    """Write the card as Markdown; notes that someone added to an earlier one stay."""
    lines = [f"# {card.title}", "", card.purpose, ""]
    for heading, rows in (("Training", card.recipe), ("Figures", card.figures)):
        lines += [f"## {heading}", "", "| | |", "|---|---|"]
        lines += [f"| {name} | {value} |" for name, value in rows.items()]
        lines.append("")
    earlier = path.read_text(encoding="utf-8") if path.exists() else ""
    if _NOTES in earlier:
        lines.append(earlier[earlier.index(_NOTES) :].rstrip())
        lines.append("")
    path.write_text("\n".join(lines), encoding="utf-8")
