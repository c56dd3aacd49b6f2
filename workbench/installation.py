"""The distribution that this package is installed from: its name, its version and its extras.

On the package index the name `workbench` belongs to another project, which has nothing to do with
this one. The distribution is therefore called `smpl-workbench`; the package that is imported and
the command that is typed are called `workbench`.
"""

from importlib.metadata import PackageNotFoundError, version

DISTRIBUTION = "smpl-workbench"
VERSION = "0.1.0"  # pyproject.toml reads it from here, so that a checkout knows it uninstalled


def version_of(distribution: str) -> str | None:
    """The version of an installed distribution, or None if it is not installed.

    That of `smpl-workbench` is the version of the code that runs, installed or not.
    """
    if distribution == DISTRIBUTION:
        return VERSION
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def pip_install(extra: str) -> str:
    """The command that installs the libraries of an extra, for the end of an error message.

    The first form needs an installation, from a wheel or editable: pip then reads the extra from
    that. The second form installs from the folder of a checkout.
    """
    return (
        f"pip install '{DISTRIBUTION}[{extra}]', or in the folder of a checkout "
        f"pip install '.[{extra}]'"
    )
