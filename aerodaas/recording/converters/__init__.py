"""How each type of item is written: one module for each family, registered by `convert`.

`convert(item, message, session)` yields the entries that `item` becomes. A plug-in whose items
deserve better than the JSON fallback registers its own::

    @convert.register
    def _(item: MyResult, message: Message[Any], session: Session) -> Iterator[Entry]: ...
"""

from aerodaas.recording.converters import images, mission, notes, vehicle, vitals
from aerodaas.recording.converters.base import Session, convert

__all__ = ["Session", "convert", "images", "mission", "notes", "vehicle", "vitals"]
