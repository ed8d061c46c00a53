from __future__ import annotations

import os
from collections.abc import Iterator
from unittest import mock

import pytest


@pytest.fixture(autouse=True)
def own_environment() -> Iterator[None]:
    """Scripts that measure on one thread say so in the environment when they are imported; other tests keep theirs."""
    with mock.patch.dict(os.environ):
        yield
