"""Every parameter of every command, from its declaration: as an option, in urmpipe.toml and as a keyword."""

import json
from collections.abc import Iterator
from inspect import Parameter, isfunction, signature
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import click
import numpy as np
import pytest

import urmpipe
from command_contexts import EVERY
from urmpipe import commands
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import FAULTS, ParamOption, long_name
from urmpipe.defaults import defaults_for
from urmpipe.main import cli, find_commands, run
from urmpipe.parameters import kinds
from urmpipe.parameters.param import Kind, Param, read_parameters
from urmpipe.parameters.shared import Processing
from urmpipe.public_functions import public_function
from urmpipe_models.errors import OptionError


class Sample(NamedTuple):
    """One value: as a text of the shell, in TOML, and in Python."""

    text: str
    toml: Any
    python: Any


def same(text: str) -> Sample:
    """Return a text that is the same in all three."""
    return Sample(text, text, text)


SAMPLES = {  # by the metavar
    "NUMBER[s|ms|us]": Sample("5ms", "5ms", 0.005),
    "NUMBER[m|mm|um|cm]": Sample("0.4mm", 0.0004, 0.0004),
    "NUMBER[m/s|mm/s]": Sample("250mm/s", 0.25, 0.25),
    "NUMBER[m/s2|mm/s2]": Sample("500mm/s2", "0.5", np.float64(0.5)),
    "NUMBER[m/s3|mm/s3]": Sample("60m/s3", 60, 60),
    "NUMBER[pt]": Sample("8pt", 8, 8.0),
    "N": Sample("3", 3, np.int64(3)),
    "V1,V2,...": Sample("100mm/s,0.2", ["100mm/s", 0.2], (0.1, 0.2)),
    "FX,FY,FZ": Sample("0,0,-50N", [0, 0, -50], np.array([0.0, 0.0, -50.0])),
    "Q1,Q2,...": Sample("0,90deg", ["0", "90deg"], ("0", "90deg")),
    "X,Y,Z[,RX,RY,RZ]": Sample("0,0,150mm", [0, 0, 0.15], (0.0, 0.0, 0.15)),
    "LINK": same("tool0"),
    "NAME|FILE": same("ur5e"),
    "comma|semicolon|tab|spaces|bar": same("tab"),
    "NAME": same("ros"),
    "COLUMN": Sample("2", 2, 2),
    "[FILE:]COLUMN": same("clock"),
    "A,B,C": Sample("a,b,2", ["a", "b", 2], ["a", "b", 2]),
    "table|transposed|long|flat:N|flat-by-joint:N": same("flat:6"),
    "NAME,...": Sample("a,b", ["a", "b"], ("a", "b")),
    "1|-1,...": Sample("1,-1", [1, -1], (1, -1)),
    "OFFSET,...": Sample("0,90.5", [0, 90.5], np.array([0.0, 90.5])),
    "SHEET": Sample("2", 2, 2),
    "TOPIC": same("/joint_states"),
    "WORD": same("arm2_solved"),
    "N|[COLUMN=]NAME": Sample("3", 3, 3),
    "FIRST:LAST[,...]": same("2:-1,-1:"),
    "[COLUMN=]UNIT": Sample("q1=deg,q2=rad", {"q1": "deg", "q2": "rad"}, {"q1": "deg", "q2": "rad"}),
    "[JOINT=]LOW:HIGH": Sample("q1=-180:180", {"q1": [-180, 180]}, {"q1": (-180.0, 180.0)}),
    "LENGTH|KIND=VALUE,...": Sample("axis=2mm,x=1mm", {"axis": "2mm", "x": "1mm"}, {"axis": 2e-3, "x": 1e-3}),
    "CRITERION=VALUE,...": Sample("AP=0.4mm,AV=5%", {"AP": "0.4mm", "AV": "5%"}, {"AP": 0.0004, "AV": 0.05}),
    "stamps|start|auto|TIME": Sample("200ms", 0.2, 0.2),
    "REFERENCE,LOG": Sample("target,actual", ["target", "actual"], ("target", "actual")),
    "FIRST:LAST,...": Sample("1:3,4:6", ["1:3", "4:6"], [(1, 3), (4, 6)]),
    "NAME=VALUE": Sample("log=a.csv", {"log": "a.csv"}, {"log": "a.csv"}),
    "CONTROL=VALUE": Sample("crank=40deg", {"crank": "40deg"}, {"crank": "40deg"}),
    "JOINT=VALUE": Sample("theta=85deg", ["theta=85deg"], {"theta": "85deg"}),
    "BODY:X,Y,Z": same("coupler:0.45,0.2,0"),
    "BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ]": Sample("b:0,0,0:0,1,0", ["b:0,0,0:0,1,0"], ("b:0,0,0:0,1,0",)),
    "FORMATS": Sample("pdf,svg", ["pdf", "svg"], ("pdf", "svg")),
    "TITLE": Sample("Dev*", ["Dev*"], "Dev*"),
    "WIDTH": same("85mm"),
}  # fmt: skip
PLATFORM = Sample("win64", "win64", ["win64"])


def sample_of(kind: Kind, name: str) -> Sample:
    """Return a value of a kind."""
    if name == "platforms":
        return PLATFORM
    if not kind.metavar:
        return Sample("", True, np.bool_(True))
    if kind.metavar.startswith("[") and kind.metavar[1:-1] == kind.allowed.replace(", ", "|"):
        return same(kind.allowed.partition(", ")[0])
    if kind.is_file and kind.metavar not in SAMPLES:
        return Sample("a.csv", "a.csv", Path("a.csv"))
    return SAMPLES[kind.metavar]


def options() -> Iterator[Any]:
    """Yield each option of each command, with the command."""
    for context in EVERY:
        for option in context.command.params:
            if isinstance(option, ParamOption):
                yield pytest.param(context, option, id=f"{context.command_path} {long_name(option)}")


def plain(value: Any) -> Any:
    """Return a value that was read, to compare it: limits without their origin, files by their names."""
    if isinstance(value, kinds.Limits):
        return dict(value.by_kind)
    return Path(value).name if isinstance(value, (str, Path)) else value


def parse(context: click.Context, words: list[str], defaults: dict[str, Any]) -> tuple[Any, list[Any]]:
    """Return the options of a line with the defaults of a file, and the faults of their values."""
    for param in context.command.params:
        if param.required and param.name not in defaults and not {*param.opts} & {*words}:
            words = [*words, "x"] if isinstance(param, click.Argument) else [*words, param.opts[0], "x"]
    parent = click.Context(cli, default_map={str(context.command.name): defaults}, **cli.context_settings)
    made = context.command.make_context(context.command.name, words, parent=parent)
    return made.params, made.meta.get(FAULTS, [])


def in_toml(value: Any) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name} = {in_toml(item)}' for name, item in value.items())}}}"
    return f"[{', '.join(map(in_toml, value))}]" if isinstance(value, list) else json.dumps(value)


def from_file(folder: Path, context: click.Context, option: ParamOption, value: Any) -> tuple[Any, list[Any]]:
    """Return the value of an option that a file sets, and the faults of it."""
    path = folder / "urmpipe.toml"
    path.write_text(f"{long_name(option)} = {in_toml(value)}\n", encoding="utf-8")
    named = {str(context.command.name): context.command}
    params, faults = parse(context, [], defaults_for(context.command, path, named))
    return params[option.name], faults


@pytest.mark.parametrize(("context", "option"), [*options()])
def test_a_parameter_is_read_alike_in_the_shell_in_toml_and_in_python(
    context: click.Context, option: ParamOption, tmp_path: Path
) -> None:
    kind, name = option.param.kind, str(option.name)
    sample = sample_of(kind, name)
    words = [option.opts[-1]] if option.is_flag else [option.opts[-1], sample.text]
    params, faults = parse(context, words, {})
    read = params[name]
    assert faults == []
    assert plain(kind.read(sample.python)) == plain(read)
    assert plain(kind.read(read)) == plain(read)  # a value that was read stays as it is
    if not option.param.each_call:
        set_by_file, faults = from_file(tmp_path, context, option, sample.toml)
        assert (plain(set_by_file), faults) == (plain(read), [])


@pytest.mark.parametrize(("context", "option"), [*options()])
def test_a_wrong_value_is_one_fault_of_its_parameter(
    context: click.Context, option: ParamOption, tmp_path: Path
) -> None:
    param, name = option.param, str(option.name)
    faults = [] if option.is_flag else [parse(context, [option.opts[-1], ""], {})[1]]
    if not param.each_call and name != "targets":  # which are an array of any class
        faults.append(from_file(tmp_path, context, option, [True])[1])
    wrong_values = ("yes" if option.is_flag else "", *([] if name == "targets" else [object()]))
    for wrong in wrong_values:
        with pytest.raises(OptionError) as error:
            read_parameters({name: param}, {name: wrong})
        faults.append(list(error.value.findings))
    for found in faults:
        assert [one.parameter for one in found] == [name]
        assert str(found[0]).startswith(f"{name}")
        assert "found " in str(found[0])
        assert "allowed: " in str(found[0])


FUNCTIONS = {name: getattr(urmpipe, name) for name in urmpipe.__all__ if isfunction(getattr(urmpipe, name))}
OF_FUNCTIONS = {
    "accuracy": "accuracy", "compare": "compare", "diagnose": "diagnose", "export": "export",
    "fmu build": "build_fmu", "ik": "ik", "ingest": "ingest", "iso": "iso", "network check": "network_check",
    "network drive": "network_drive", "network solve": "network_solve", "plan": "plan", "report": "report",
    "robot equations": "equations", "simulate": "simulate", "view": "view",
}  # fmt: skip


@pytest.mark.parametrize(("path", "function"), OF_FUNCTIONS.items())
def test_each_option_is_a_keyword_of_the_function_and_each_keyword_an_option(
    path: str, function: str
) -> None:
    context = next(one for one in EVERY if one.command_path == f"urmpipe {path}")
    options = [one for one in context.command.params if isinstance(one, ParamOption)]
    parameters = signature(FUNCTIONS[function]).parameters
    assert {one.name for one in options if one.param.python} <= set(parameters)
    of_python = {"inputs", "defaults", "progress", "on_message", "t", "q", "recorded_tcp", "names", "name"}
    named = {one.name for one in context.command.params} | of_python
    keywords = {name for name, one in parameters.items() if one.kind == Parameter.KEYWORD_ONLY}
    assert keywords <= named


@pytest.mark.parametrize("function", FUNCTIONS)
def test_all_wrong_keywords_are_one_error_before_the_work(function: str) -> None:
    parameters = signature(FUNCTIONS[function]).parameters
    # Arrays and operands, which the work checks
    unread = {"t", "q", "recorded_tcp", "names", "logs", "log", "targets"}
    wrong = {
        name: object()
        for name, one in parameters.items()
        if one.default is not Parameter.empty and name not in unread
    }
    operands = [Path("missing") for one in parameters.values() if one.default is Parameter.empty]
    if wrong:
        with pytest.raises(OptionError) as error:
            FUNCTIONS[function](*operands, **wrong)
        assert {one.parameter for one in error.value.findings} >= set(wrong)


class Toy(Processing, total=False):
    """A group of parameters with one more field."""

    gain: Annotated[float | str | None, Param(kinds.number("m"), "Gain of the toy.")]


def test_a_new_option_is_one_field(tmp_path: Path) -> None:
    @public_function(Toy)
    def toy(**options: Any) -> Any:
        return options

    @command(Toy, short_help="A toy.")
    def toys(call: Call, **options: Any) -> Answer:
        return Answer(to_dict=lambda: {"values": toy(**options)})

    assert toy(gain="5mm") == {"tsp": None, "derivative": None, "gain": 0.005}
    assert str(signature(toy).parameters["gain"]).startswith("gain: float | str | None = None")
    with pytest.raises(OptionError, match=r"^gain \(--gain\): found '5 kg', allowed: a length in m, such as"):
        toy(gain="5 kg")
    context = click.Context(toys, info_name="toys")
    assert "--gain NUMBER[m|mm|um|cm]" in context.get_help()
    option = next(one for one in toys.params if one.name == "gain")
    assert isinstance(option, ParamOption)
    assert from_file(tmp_path, context, option, "5mm") == (0.005, [])


TOY_COMMAND = '''"""Print a toy."""

from urmpipe.answers import Answer, Call, command


@command()
def toy(call: Call) -> Answer:
    """Print a toy."""
    return Answer(lines=["a toy"], to_dict=lambda: {"toy": True}, verdict="fail")
'''


def test_a_new_command_is_one_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "toy.py").write_text(TOY_COMMAND, encoding="utf-8")
    monkeypatch.setattr(commands, "__path__", [*commands.__path__, str(tmp_path)])
    assert find_commands()["toy"] == "Print a toy."
    assert run(["toy"]) == 1
    assert capsys.readouterr().out == "a toy\n"
    assert run(["toy", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"toy": True}
    assert run(["--help"]) == 0
    assert "  toy       Print a toy.\n" in capsys.readouterr().out


@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_both_names_of_help_work(flag: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ingest", flag]) == 0
    assert capsys.readouterr().out.startswith("Usage: urmpipe ingest [OPTIONS] LOG...\n")
