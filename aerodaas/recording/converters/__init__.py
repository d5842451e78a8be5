"""Converters from each type of item to recorded entries, registered with `convert`.

`convert(item, message, session)` yields the entries of `item`. A plug-in can replace the JSON
fallback for its own type of item::

    @convert.register
    def _(item: MyResult, message: Message[Any], session: Session) -> Iterator[Entry]: ...
"""

from aerodaas.recording.converters import images, mission, vehicle
from aerodaas.recording.converters.base import Session, convert

__all__ = ["Session", "convert", "images", "mission", "vehicle"]
