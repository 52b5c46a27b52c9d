"""`write_new`: the one place where a template becomes a file; a file that is there is not replaced unasked."""

from pathlib import Path

from foundation import InputError, writing_whole_file


def write_new(out: Path, text: str, *, force: bool) -> None:
    """Write a template.

    Raises
    ------
    InputError
        A file of that name is there, and it was not said that it may be replaced.
    """
    if out.exists() and not force:
        raise InputError(f"{out} is there already; name another file, or replace it with --force")
    with writing_whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
