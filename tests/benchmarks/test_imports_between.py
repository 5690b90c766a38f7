"""Imports between areas, and rings of modules and folders."""

from __future__ import annotations

from pathlib import Path

import pytest
from survey.imports import rings, top_level
from survey.source import read_source
from survey.tables import full

from measured_tree import faults, measured


def test_imports_the_wrong_way_are_told_wherever_they_stand(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__arm="def _f() -> None:\n    from urmpipe import main\n",
        pipeline__urmpipe_pipeline__log="import urmpipe_models.arm\n",
    )
    assert faults(house) == {"imports the wrong way": ("models/urmpipe_models/arm.py imports cli",)}
    assert house.imports == {("models", "cli"): 1, ("pipeline", "models"): 1}


@pytest.mark.parametrize(
    "call",
    [
        'import_module("urmpipe.main")',
        'importlib.import_module("urmpipe.main")',
        'getattr(import_module(f"urmpipe.commands.{name}"), name)',
    ],
)
def test_what_is_imported_by_a_text_is_told_too(tmp_path: Path, call: str) -> None:
    house = measured(
        tmp_path, models__urmpipe_models__arm=f"def _f(name: str) -> None:\n    found = {call}\n"
    )
    assert faults(house) == {"imports the wrong way": ("models/urmpipe_models/arm.py imports cli",)}
    assert house.imports == {("models", "cli"): 1}


def test_a_text_that_is_not_written_out_or_not_imported_is_none(tmp_path: Path) -> None:
    text = """
        def _f(name: str) -> None:
            import_module(name)
            import_module(f"{name}.main")
            load("urmpipe.main")
        """
    assert measured(tmp_path, models__urmpipe_models__arm=text).imports == {}


def test_a_library_that_is_imported_by_a_text_counts_as_imported(tmp_path: Path) -> None:
    path = tmp_path / "models" / "arm.py"
    path.parent.mkdir()
    path.write_text('with import_module("rerun.blueprint") as a:\n    pass\n', encoding="utf-8")
    assert top_level([read_source(path, tmp_path)]) == {"rerun"}


def test_a_ring_may_be_closed_by_a_text(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__a="from urmpipe_models import b\n",
        models__urmpipe_models__b='if True:\n    a = import_module("urmpipe_models.a")\n',
        models__urmpipe_models__c='def _f() -> None:\n    import_module("urmpipe_models.d")\n',
        models__urmpipe_models__d='import_module("urmpipe_models.c")\n',
    )
    assert house.module_rings == ("urmpipe_models.a ~ urmpipe_models.b",)


def test_a_ring_counts_when_modules_are_loaded_and_not_in_functions_or_for_type_checkers(
    tmp_path: Path,
) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__a="from urmpipe_models import b\n",
        models__urmpipe_models__b="try:\n    import urmpipe_models.c\nfinally:\n    pass\n",
        models__urmpipe_models__c="from urmpipe_models.a import X\n",
        models__urmpipe_models__d="def _f() -> None:\n    import urmpipe_models.e\n",
        models__urmpipe_models__e="import urmpipe_models.f\nimport urmpipe_models.d\n",
        models__urmpipe_models__f="if TYPE_CHECKING:\n    import urmpipe_models.e\n",
    )
    ring = "urmpipe_models.a ~ urmpipe_models.b ~ urmpipe_models.c"
    assert faults(house) == {
        "rings of modules": (ring,),
        "rings of folders": (
            f"{ring}: urmpipe_models.a -> urmpipe_models.b, urmpipe_models.b -> urmpipe_models.c,"
            " urmpipe_models.c -> urmpipe_models.a",
        ),
    }


def test_relative_imports_count_as_what_they_stand_for(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__a="from .part import b\n",
        models__urmpipe_models__part__b="from . import c\n",
        models__urmpipe_models__part__c="from ..a import X\n",
    )
    assert house.module_rings == ("urmpipe_models.a ~ urmpipe_models.part.b ~ urmpipe_models.part.c",)


def test_a_package_imports_from_itself_with_one_dot(tmp_path: Path) -> None:
    package = tmp_path / "models" / "urmpipe_models" / "part"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text('"""A package."""\n\nfrom .b import X\n', encoding="utf-8")
    house = measured(tmp_path, models__urmpipe_models__part__b="from urmpipe_models.part import Y\n")
    assert house.module_rings == ("urmpipe_models.part ~ urmpipe_models.part.b",)


def test_a_ring_of_folders_needs_no_ring_of_modules(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        cli__urmpipe__one__a="import urmpipe.two.a\n",
        cli__urmpipe__two__a="",
        cli__urmpipe__two__b="import urmpipe.one.b\n",
        cli__urmpipe__one__b="",
    )
    assert faults(house) == {
        "rings of folders": (
            "urmpipe.one ~ urmpipe.two: urmpipe.one.a -> urmpipe.two.a, urmpipe.two.b -> urmpipe.one.b",
        )
    }


def test_rings_are_the_strongly_connected_components() -> None:
    graph = {"a": {"b"}, "b": {"c", "d"}, "c": {"a"}, "d": {"e"}, "e": {"d"}, "f": {"a", "f"}}
    assert rings(graph) == [("d", "e"), ("a", "b", "c")]


def test_what_runs_where_types_are_not_checked_counts(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__a="if TYPE_CHECKING:\n    pass\nelse:\n    import urmpipe_models.b\n",
        models__urmpipe_models__b="import urmpipe_models.a\n",
    )
    assert house.module_rings == ("urmpipe_models.a ~ urmpipe_models.b",)


def test_the_table_of_imports_has_a_dot_where_none_is_allowed(tmp_path: Path) -> None:
    house = measured(tmp_path, cli__urmpipe__a="import urmpipe_models.b\n", models__urmpipe_models__b="")
    assert "| cli | 1 | 0 | 0 | . | 0 | . | . | . |" in full(house)
    assert "| models | . | . | . | . | 0 | . | . | . |" in full(house)
