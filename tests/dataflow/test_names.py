"""One mechanism spells every name both ways."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.dataflow.names import PaperNames, snake_case

words = st.lists(st.from_regex(r"[a-z][a-z0-9]{1,6}", fullmatch=True), min_size=1, max_size=5)


@given(words)
def test_camel_case_comes_back_as_it_was(parts: list[str]) -> None:
    """A snake_case name written in camelCase is found again."""
    camel = parts[0] + "".join(part.capitalize() for part in parts[1:])
    assert snake_case(camel) == "_".join(parts)


@given(words)
def test_snake_case_stays(parts: list[str]) -> None:
    """What is spelled in snake_case already does not change."""
    name = "_".join(parts)
    assert snake_case(name) == name
    assert snake_case(snake_case(name)) == name


def test_acronyms_of_the_paper() -> None:
    """ID and Id are one word, wherever they stand."""
    assert snake_case("getRobotByID") == snake_case("getRobotById") == "get_robot_by_id"
    assert snake_case("getSensorID") == "get_sensor_id"
    assert snake_case("VipDetectionAnalytics") == "vip_detection_analytics"


class Thing(PaperNames):
    """Has a method, and a property that fails."""

    def do_it(self) -> int:
        """Return 1."""
        return 1

    @property
    def broken(self) -> int:
        """Ask for what is not there."""
        return int(self.not_there)


def test_an_attribute_error_names_what_was_asked_for() -> None:
    """Both spellings work; an unknown name is an AttributeError, inside a property, too."""
    thing = Thing()
    assert thing.doIt() == thing.do_it() == 1
    assert getattr(thing, "doThat", None) is None
    assert getattr(thing, "_doIt", None) is None
    assert not hasattr(thing, "broken")
