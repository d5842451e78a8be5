"""Which topics of a ROS 2 bag are taken, and for what."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Topic
from aerodaas.recording.ros import typestore

__all__ = ["BagTopics", "Taken", "use_of"]

_TYPES = {
    "camera": (typestore.COMPRESSED_IMAGE, typestore.IMAGE),
    "odometry": (typestore.ODOMETRY,),
    "gps": (typestore.NAV_SAT_FIX,),
    "battery": (typestore.BATTERY,),
    "detections": (typestore.DETECTIONS,),
}
"""Types that a topic may have, by its use."""
_SINGLE = ("odometry", "gps", "battery")


class Taken(NamedTuple):
    """A topic that is taken."""

    use: str
    """An option of `aerodaas import`."""
    name: str
    """Id of the sensor, or name of the analysis."""
    topic: str


@dataclass(frozen=True, slots=True)
class BagTopics:
    """Topics by their use, and by the id of the sensor or analysis that they become."""

    robot: str = "drone"
    """Id that the recording gives the vehicle."""
    camera: Mapping[str, str] = field(default_factory=dict)
    odometry: Mapping[str, str] = field(default_factory=dict)
    """One at most, for a vehicle is at one place; as with fix and battery."""
    gps: Mapping[str, str] = field(default_factory=dict)
    battery: Mapping[str, str] = field(default_factory=dict)
    detections: Mapping[str, str] = field(default_factory=dict)

    def taken(self) -> list[Taken]:
        """All topics."""
        return [Taken(use, *one) for use in _TYPES for one in getattr(self, use).items()]

    def check(self, known: Mapping[str, Topic]) -> None:
        """Compare with the topics of a bag.

        Raises:
            RecordingError: If nothing can be made of them: neither a camera nor odometry, a topic
                that is not there, of another type or taken twice, two streams of one name.
        """
        taken = self.taken()
        if not self.camera and not self.odometry:
            raise RecordingError("take at least a camera or odometry from the bag")
        for use, _, topic in taken:
            fitting = [name for name, one in known.items() if one.schema in _TYPES[use]]
            if topic not in fitting:
                found = f"is {known[topic].schema}" if topic in known else "is not there"
                raise RecordingError(
                    f"{topic} {found}; {use} takes {' or '.join(_TYPES[use])}, and the bag has: "
                    f"{', '.join(sorted(fitting)) or 'none'}"
                )
            if use in _SINGLE and len(getattr(self, use)) > 1:
                raise RecordingError(f"take one topic for {use}, not {len(getattr(self, use))}")
        for index, what in ((1, "stream"), (2, "topic")):
            name, count = Counter(one[index] for one in taken).most_common(1)[0]
            if count > 1:
                raise RecordingError(f"the {what} {name!r} is named {count} times; name others")


def use_of(schema: str) -> str:
    """What a topic of this type can be taken for: an option of `aerodaas import`; or empty."""
    return next((use for use, types in _TYPES.items() if schema in types), "")
