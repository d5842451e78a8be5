"""An analysis of your own: how bright a picture is."""

from typing import ClassVar

from aerodaas import Alert, Analytics, Frame
from aerodaas.analytics.base import Context


class Darkness(Analytics[float]):
    """Mean brightness of each picture, 0 to 255, with an alert when it gets dark."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)

    def __init__(self, below: float) -> None:
        """Tell of pictures darker than `below`."""
        self.below = below
        self.was_dark = False

    def process(self, item: Frame, context: Context) -> float:
        """Return the brightness; None would say that there is no result."""
        mean = float(item.image.mean())
        if mean < self.below and not self.was_dark:
            context.alert(Alert(item.header, "dark", f"only {mean:.0f} of 255", {"mean": mean}))
        self.was_dark = mean < self.below
        return mean
