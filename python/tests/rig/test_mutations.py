"""Each mistake of tests/firmware/mutations.toml is noticed by the test that is named for it."""

import mutations
import pytest


@pytest.fixture(scope="module")
def codec(tmp_path_factory):
    """Made once."""
    return mutations.codec(tmp_path_factory.mktemp("codec"))


@pytest.mark.parametrize("mutation", mutations.mutations(), ids=lambda mutation: mutation.name)
def test_a_mistake_in_the_firmware_is_caught(mutation, codec, tmp_path):
    outcomes = mutations.run(tmp_path, mutations.build(tmp_path, codec, mutation), "-k", mutation.caught_by)
    assert outcomes == {mutation.caught_by: "failed"}


def test_the_page_has_a_row_for_each_mistake():
    page = mutations.PAGE.read_text()
    assert [mutation.name for mutation in mutations.mutations() if f"| {mutation.name}: {mutation.about} |" not in page] == []
