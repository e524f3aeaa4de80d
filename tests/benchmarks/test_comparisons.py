"""The page of comparisons says what the saved runs say."""

from benchmarks.write_comparisons import PAGE, page


def test_the_page_is_what_its_script_writes():
    assert PAGE.read_text() == page()
