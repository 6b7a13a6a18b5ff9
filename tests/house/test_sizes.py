"""The sizes of installations that pages state are those that `make sizes` has measured."""

from installing.sizes import PAGES, in_words, stated


def test_the_pages_stated_different_sizes() -> None:
    """The README and the manual said 95 MB for what takes 139 MB, from no command."""
    for extra in ("", "demo"):
        found = {page: stated(page, extra) for page in PAGES}
        assert all(found.values()), found
        assert len({size for sizes in found.values() for size in sizes}) == 1, found


def test_sizes_are_written_as_pages_state_them() -> None:
    assert in_words(139_400_000) == "139 MB"
    assert in_words(5_312_000_000) == "5.3 GB"
