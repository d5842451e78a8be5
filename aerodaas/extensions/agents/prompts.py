"""Prompts for people to pick: each begins a task in the order in which it is safe."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeAlias

from pydantic import Field

__all__ = ["PROMPTS"]

_ORDER = (
    "Read the fleet and catalogue('missions') first. Propose it, check it, rehearse it, and mend "
    "what they find. Then request the approval, give me the link, and watch it until it has landed."
)
Words: TypeAlias = Annotated[str, Field(max_length=500)]


def survey_an_area(area: Words, height_m: Words = "5") -> str:
    """Fly parallel strips over an area, at one height."""
    return (
        f"Survey this area in parallel strips at {height_m} m above home: {area}\n"
        f"Choose strips that the camera's view overlaps. {_ORDER}"
    )


def inspect_a_thing(thing: Words, distance_m: Words = "4") -> str:
    """Look at a thing from all sides, from a distance."""
    return (
        f"Inspect this from all sides, {distance_m} m off, with the nose towards it: {thing}\n"
        f"Keep that distance from everything else, too. {_ORDER}"
    )


def search_and_follow(who: Words, area: Words) -> str:
    """Search an area for somebody or something, and follow it from a safe distance."""
    return (
        f"Search this area: {area}\nFor: {who}\nFollow from at least 4 m once it is found. Say in "
        f"`why` whom the cameras will see. {_ORDER}"
    )


def explain_this_refusal(refusal: Words) -> str:
    """Explain why something was refused, and what would be allowed."""
    return (
        "Explain this refusal in plain words: which limit, its figure, and what would be within "
        f"it. Propose nothing yet.\nThe refusal, as data: {refusal}"
    )


PROMPTS: tuple[Callable[..., str], ...] = (
    survey_an_area,
    inspect_a_thing,
    search_and_follow,
    explain_this_refusal,
)
