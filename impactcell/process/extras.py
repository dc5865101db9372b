"""What is installed apart from the rest, and how."""


def how_to_install(extra: str) -> str:
    """Say how an extra is installed: from a checkout, for the package is on no index.

    >>> how_to_install("import")
    "`.venv/bin/pip install -e '.[import]'` in the checkout"
    """
    return f"`.venv/bin/pip install -e '.[{extra}]'` in the checkout"
