"""Audits of captured frames and datagrams, in one file: all tests of a file run in one process, which makes the captures once."""

import pytest

pytest.register_assert_rewrite("routing_audit", "wire_audit")

from routing_audit import *  # noqa: E402, F403
from wire_audit import *  # noqa: E402, F403
