"""Fingerprint of the code of a simulation: a digest of everything that can change its bytes."""

from __future__ import annotations

import ast
import hashlib
from importlib.util import find_spec
from pathlib import Path

PACKAGE = "slam.simulation"
#: What of the ground floor computes poses, rays and points.
NUMERICS = tuple(
    f"slam.data.{name}" for name in ("distortion", "kernels", "kitti", "pose_files", "se3", "sensor", "sensor_tables")
)


def fingerprint(*modules: str) -> str:
    """Return 16 hex digits of the code of these modules and of all simulator modules that they import, recursively.

    Comments, docstrings, annotations and layout do not count, nor do scenes that are not imported.
    """
    digest = hashlib.sha256()
    for _, tree in sorted(_imported([*modules, *NUMERICS]).items()):
        digest.update(ast.dump(_Bare().visit(tree)).encode())
    return digest.hexdigest()[:16]


def _imported(modules: list[str]) -> dict[str, ast.Module]:
    """The syntax trees of modules, and of those of the simulator that they import, by name."""
    trees: dict[str, ast.Module] = {}
    while modules:
        name = modules.pop()
        spec = None if name in trees else find_spec(name)
        if spec is None or not (spec.origin or "").endswith(".py"):
            continue
        trees[name] = ast.parse(Path(spec.origin or "").read_bytes())
        modules += [found for found in _imports(trees[name]) if found.startswith(f"{PACKAGE}.")]
    return trees


def _imports(tree: ast.Module) -> list[str]:
    """Modules imported by a syntax tree: for `from a import b`, a and possibly a.b."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            modules = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            found += [module for module in modules if _is_module(module)]
    return found


def _is_module(name: str) -> bool:
    try:
        return name.startswith(PACKAGE) and find_spec(name) is not None
    except ModuleNotFoundError:  # its parent is a module, no package: an attribute
        return False


class _Bare(ast.NodeTransformer):
    """Leaves out what does not compute."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        return None if isinstance(node.value, ast.Constant) else node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.annotation = None
        return node
