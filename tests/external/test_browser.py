"""The browser of the tests starts whatever else the tests' process has open."""

import os

import pytest
from browser import visit


@pytest.mark.parametrize("first_free", [3, 4, 17, 18, 20, 21])
def test_the_browser_answers_whichever_descriptors_its_pipes_get(first_free, tmp_path):
    held = []
    try:
        while not held or held[-1] < first_free - 1:
            held.append(os.open(os.devnull, os.O_RDONLY))
        page = visit("about:blank", tmp_path, expressions={"sum": "1 + 1"})
    finally:
        for descriptor in held:
            os.close(descriptor)
    assert page.values["sum"] == 2
