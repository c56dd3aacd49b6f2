"""`workbench info`: versions, threads, and which arithmetic is active and why."""

import logging
import os
import platform

import typer
from rich.console import Console
from rich.logging import RichHandler
from rich.markup import escape

from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_body
from workbench.bodies.forward.compiled import mesh_library
from workbench.bodies.forward.posed_points import WORTH_COMPILING
from workbench.bodies.triangles import TriangleBody
from workbench.comparison.record import processor
from workbench.compiling import NoLibrary, cache_folder, find_compiler
from workbench.reports.page import versions
from workbench.threads import blas_libraries, thread_count

VARIABLES = ("WORKBENCH_COMPILE", "WORKBENCH_CACHE", "WORKBENCH_THREADS", "CC", "OMP_NUM_THREADS")


def info(
    body: str = typer.Option("default", help="The body whose arithmetic is reported."),
) -> None:
    """Print versions, threads, the compiler, the cache, and how surfaces are computed."""
    console = Console()
    handler = RichHandler(console=console, show_time=False, show_level=False, show_path=False)
    logging.basicConfig(level=logging.INFO, format="%(message)s", handlers=[handler])
    for label, text in _facts(body):
        console.print(f"[bold]{label:16}[/]{escape(text)}", highlight=False, soft_wrap=True)


def _facts(name: str) -> list[tuple[str, str]]:
    model = load_body(name)
    return [
        ("surfaces", f"{_arithmetic(model)}; {name} has {model.n_vertices} vertices"),
        ("compiler", _compiler()),
        ("cache", _cache()),
        ("BLAS threads", f"{thread_count()} in a run (WORKBENCH_THREADS sets it)"),
        *(("BLAS", text) for text in blas_libraries()),
        ("processor", f"{processor()}, {os.cpu_count()} cores"),
        ("system", f"{platform.system()} {platform.release()}, {platform.machine()}"),
        *((package, number or "not installed") for package, number in versions().items()),
        *((name, os.environ[name]) for name in VARIABLES if name in os.environ),
    ]


def _arithmetic(model: SkinnedBody | TriangleBody) -> str:
    if isinstance(model, TriangleBody):
        return "NumPy, and a sparse factorization that stitches triangles"
    library, why = mesh_library(model.parents, model.n_betas, model.numeric.packing.single)
    return (
        f"compiled from {WORTH_COMPILING} vertices on, NumPy below" if library else f"NumPy: {why}"
    )


def _compiler() -> str:
    try:
        compiler = find_compiler()
    except NoLibrary as error:
        return f"none: {error}"
    return f"{' '.join(compiler.command)} {compiler.version}, {compiler.native}"


def _cache() -> str:
    try:
        folder = cache_folder()
    except NoLibrary as error:
        return f"none: {error}"
    files = sorted(folder.glob("*.so")) if folder.is_dir() else []
    size = sum(file.stat().st_size for file in files)
    return f"{folder}: {len(files)} libraries, {size / 1e6:.1f} MB"
