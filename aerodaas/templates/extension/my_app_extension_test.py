"""The extension keeps the rules: `pytest`, in this folder."""

from my_app_extension import EXTENSION

from aerodaas.testing.extension_kit import check_extension


def test_the_extension_keeps_the_rules() -> None:
    """All that it names can be imported, and hides nothing of the core's."""
    check_extension(EXTENSION)
