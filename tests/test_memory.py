"""What tests cached is freed after them."""

import gc
import weakref
from functools import cache
from types import ModuleType

from tests.memory import collect, forget


class Thing:
    pass


def test_caches_of_a_module_are_emptied_and_those_that_it_imported_are_not() -> None:
    @cache
    def own() -> Thing:
        return Thing()

    @cache
    def imported() -> Thing:
        return Thing()

    module = ModuleType("a_file_of_tests")
    own.__module__, imported.__module__ = module.__name__, "another"
    vars(module).update(own=own, imported=imported, number=3)
    mine, others = weakref.ref(own()), weakref.ref(imported())
    forget(module)
    gc.collect()
    assert mine() is None
    assert others() is not None


def test_what_refers_to_itself_is_freed() -> None:
    thing = Thing()
    thing.me = thing
    kept = weakref.ref(thing)
    del thing
    collect()
    assert kept() is None
