"""The examples in the docstrings of eval are true."""

import doctest
import pkgutil
from importlib import import_module

import numpy as np
import pytest

MODULES = [module.name for module in pkgutil.walk_packages(import_module("eval").__path__, "eval.")]


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples_are_true(name):
    assert doctest.testmod(import_module(name), extraglobs={"np": np}).failed == 0
