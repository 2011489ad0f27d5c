"""How far work is, for people: a bar of tqdm where that is installed, or a callback."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Union

#: ``progress(stage, done, of)``: what the work is at, in words; what is done; of how much (0: not known).
Callback = Callable[[str, int, int], Any]

#: ``True`` for a bar (nothing without tqdm), a callback, or ``None`` for silence.
Progress = Union[bool, Callback, None]


@contextmanager
def told(progress: Progress) -> Iterator[Callback | None]:
    """The callback that the extension calls, and the end of a bar."""
    if progress is None or progress is False:
        yield None
        return
    if callable(progress):
        yield progress
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        yield None
        return
    bar = tqdm(total=None, leave=False)

    def tell(stage: str, done: int, of: int) -> None:
        bar.set_description(stage, refresh=False)
        bar.total = of or None
        bar.n = done
        bar.refresh()

    try:
        yield tell
    finally:
        bar.close()
